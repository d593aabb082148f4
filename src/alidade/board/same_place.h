#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_view.h"

namespace alidade {

/// Whether two views show the board at the same place in the image: four in five of the corners of each are in both,
/// all of them within `near_px`.
[[nodiscard]] bool at_one_place(const BoardView& a, const BoardView& b, double near_px);

/// For each view the index of an earlier one with identical corners: the same image under any name.
/// Noise makes any two images of one scene differ; an image used twice would halve its variance.
[[nodiscard]] std::vector<std::optional<std::size_t>> repeated_views(std::span<const BoardView> views);

/// The corners of the first view, each averaged over the views that have it.
[[nodiscard]] std::vector<Corner> mean_corners(std::span<const BoardView> views);

}  // namespace alidade
