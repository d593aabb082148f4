#pragma once

#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace alidade {

/// The border of the board's points as a lens shows it; what it does not show is omitted.
[[nodiscard]] std::vector<Eigen::Vector2d> outline_of(const Camera& camera,
                                                      const std::vector<Eigen::Vector3d>& board_points,
                                                      const Rigid3& cam_from_board);

}  // namespace alidade
