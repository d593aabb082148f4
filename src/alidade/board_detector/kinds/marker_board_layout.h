#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "alidade/board/board.h"

namespace alidade {

/// Where the markers are on a board, and how its points look.
struct MarkerLayout {
  std::string dictionary;
  int border_bits = 1;
  /// Index = the marker's number: its corners in frame board [m], top-left, top-right, bottom-right, bottom-left.
  std::vector<std::array<Eigen::Vector2d, 4>> markers;
  /// Index = the point's number: whether the quadrant between +x and +y of the point is bright.
  std::vector<bool> bright;
  double clear_m = 0.0;  ///< Around a point there are only two edges, up to this distance along each axis.
  double pitch_m = 0.0;  ///< Distance between markers.
};

/// The print variants of such a board, the usual one first. Charuco: with a black or (OpenCV before 4.6, an even
/// number of rows of squares) with a white square at the top left. Aprilgrid: Kalibr's, numbered from the bottom left,
/// with a border of two bits or one; and the same numbered from the top left.
[[nodiscard]] std::vector<MarkerLayout> marker_layouts(const Board& board);

}  // namespace alidade
