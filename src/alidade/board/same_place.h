#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_view.h"

namespace alidade {

/// Whether two views show the board at one place in the image: four in five of the corners of each are in both, all of
/// these within `near_px`.
[[nodiscard]] bool at_one_place(const BoardView& a, const BoardView& b, double near_px);

/// For each view the number of an earlier one with the very same corners: an image given twice, under whatever name.
/// Noise moves two images of one scene apart; counted twice, one image would halve the variance that it has.
[[nodiscard]] std::vector<std::optional<std::size_t>> repeated_views(std::span<const BoardView> views);

/// The corners of the first view, each the mean over the views that have it.
[[nodiscard]] std::vector<Corner> mean_corners(std::span<const BoardView> views);

}  // namespace alidade
