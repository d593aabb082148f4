#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_view.h"

namespace alidade {

/// For each view the index of an earlier one that shows the board at the same place (within two pixels, corner by
/// corner) and has the same residuals [px] to within half of their variance: frames of an unmoved board and camera
/// share the errors of the optics and of the corner detector at that place. Treated as independent, n of them would
/// divide the variance by n. Views at the same place with independent errors do not count as repeated.
[[nodiscard]] std::vector<std::optional<std::size_t>> views_with_shared_errors(
    std::span<const BoardView> views, std::span<const std::vector<Eigen::Vector2d>> residuals);

}  // namespace alidade
