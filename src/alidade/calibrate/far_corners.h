#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/board/board_view.h"

namespace alidade {

/// Gross outliers: corners too far from the others of their photo for any perspective, in the view's order; empty if
/// there are none. A least-squares initial guess would adapt to one of them and reject the rest.
[[nodiscard]] std::vector<bool> far_corners(const BoardView& view, const std::vector<Eigen::Vector3d>& board_points);

/// The view without them; `far` is not empty.
[[nodiscard]] BoardView without(const BoardView& view, const std::vector<bool>& far);

}  // namespace alidade
