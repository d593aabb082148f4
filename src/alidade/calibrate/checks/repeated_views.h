#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_view.h"

namespace alidade {

/// For each view the number of an earlier one that shows the board at the same place (within two pixels, corner by
/// corner) and has the same residuals [px] but for half of their variance: frames of a board and a camera that stand
/// still share what the optics and the corner finder do at that place. Counted as independent, n of them would divide
/// the variance by n. Views at one place whose errors are independent do not repeat each other.
[[nodiscard]] std::vector<std::optional<std::size_t>> views_with_shared_errors(
    std::span<const BoardView> views, std::span<const std::vector<Eigen::Vector2d>> residuals);

}  // namespace alidade
