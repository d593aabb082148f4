#pragma once

#include "alidade/rig/rig.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// The rig in the world that is written: the first head's camera at readings of zero; with its covariance.
struct WorldAtCamera {
  Rig rig;
  Rigid3 world_from_old;  ///< Takes points of the solver's world into this one.
  Eigen::MatrixXd J;      ///< Of the rig's parameters by the free ones.
};
/// `cov`: of the free parameters of the problem. Tilt zeros are where the camera looks square to the pan axis.
[[nodiscard]] WorldAtCamera world_at_camera(const RigProblem& problem, const RigState& state,
                                            const Eigen::MatrixXd& cov);

/// Derivatives of cam_from_cam(first, second) at these readings (translation, rotation; on the right) by the
/// parameters of all heads that have a variance in the rig's covariance.
[[nodiscard]] Eigen::Matrix<double, 6, Eigen::Dynamic> relative_jacobian(const Rig& rig, std::size_t first,
                                                                         const Eigen::Vector2d& first_rad,
                                                                         std::size_t second,
                                                                         const Eigen::Vector2d& second_rad);

/// σ between cameras over the angles that the views cover.
void add_relative_sigma(RigReport& report);

}  // namespace alidade
