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

/// σ between cameras over the angles that the views cover.
void add_relative_sigma(RigReport& report);

}  // namespace alidade
