#pragma once

#include <array>
#include <optional>
#include <string>

#include "alidade/board_detector/corner_grid.h"

namespace alidade {

/// Which sides of a grid are known to be borders of the board: i_min, i_max, j_min, j_max.
using GridBorders = std::array<bool, 4>;

/// A grid with the board's numbering: key (column, row) from (0, 0); or the reason why it is ambiguous.
struct PlacedGrid {
  CornerGrid grid;
  std::string reason;
};

/// Numbers a grid as a board of cols × rows inner corners, never mirrored. The square outside corner (0, 0) is the dark
/// one if the pattern has only one such position; if rotated boards look the same, columns run to the right in
/// the image. A partial board is placed if its size, colours and `borders` allow one position only.
[[nodiscard]] PlacedGrid place_grid(const CornerGrid& grid, int cols, int rows, const GridBorders& borders = {});

}  // namespace alidade
