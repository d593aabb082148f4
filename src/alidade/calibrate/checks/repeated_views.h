#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_view.h"

namespace alidade {

/// For each view the number of an earlier one with the very same corners: an image given twice, under whatever name.
/// Noise moves two images of one scene apart; counted twice, one image would halve the variance that it has.
[[nodiscard]] std::vector<std::optional<std::size_t>> repeated_views(std::span<const BoardView> views);

}  // namespace alidade
