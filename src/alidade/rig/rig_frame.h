#pragma once

#include "alidade/rig/rig.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// The rig in the world frame that is written: the first head's camera at zero readings; with its covariance.
struct WorldAtCamera {
  Rig rig;
  Rigid3 world_from_old;  ///< Transforms points of the solver's world into this one.
  Eigen::MatrixXd J;      ///< ∂ rig parameters / ∂ free parameters.
};
/// `cov`: of the free parameters of the problem. Zero tilt: the camera looks perpendicular to the pan axis.
[[nodiscard]] WorldAtCamera world_at_camera(const RigProblem& problem, const RigState& state,
                                            const Eigen::MatrixXd& cov);

/// Derivatives of cam_from_cam(first, second) at these readings (right perturbation: translation, rotation) with
/// respect to the parameters of all heads that have a variance in the rig's covariance.
[[nodiscard]] Eigen::Matrix<double, 6, Eigen::Dynamic> relative_jacobian(const Rig& rig, std::size_t first,
                                                                         const Eigen::Vector2d& first_rad,
                                                                         std::size_t second,
                                                                         const Eigen::Vector2d& second_rad);

/// σ between cameras over the angles that the views cover.
void add_relative_sigma(RigReport& report);

}  // namespace alidade
