#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "alidade/geometry/rigid3.h"

namespace alidade {

/// The up to four poses, world_from_cam, from which three points lie on three rays (directions in the camera's frame,
/// of any length). J. A. Grunert, 1841, as R. M. Haralick et al. write it, "Review and Analysis of Solutions of the
/// Three Point Perspective Pose Estimation Problem", IJCV 13(3), 1994. Empty where the points or rays do not determine
/// one: on a line, or two alike.
[[nodiscard]] std::vector<Rigid3> three_point_poses(const std::array<Eigen::Vector3d, 3>& points_in_world,
                                                    const std::array<Eigen::Vector3d, 3>& rays_in_cam);

}  // namespace alidade
