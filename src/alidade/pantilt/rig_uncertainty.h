#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/pantilt/rig.h"
#include "alidade/public.h"

// The uncertainty of what a rig file states, in a form that estimators can consider (Schmidt–Kalman).

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// At most so many directions of error are considered; see rig_uncertainty().
inline constexpr int max_rig_errors = 32;

/// ∂ pixel / ∂ u of one observation.
using RigErrorEffect = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, max_rig_errors>;

/// The errors of a rig's heads, lenses and clocks as p = p̂ + factor[h] u, u ~ N(0, 1) of all heads together. The rows
/// of a factor: the head's parameters (head_param_names), its lens' (param_names), the delay of its clock [s].
struct RigUncertainty {
  std::vector<Eigen::MatrixXd> factor;  ///< One per head; empty: nothing is uncertain.

  [[nodiscard]] int num() const { return factor.empty() ? 0 : static_cast<int>(factor.front().cols()); }
};

/// Covariance of the heads' parameters, then of the lenses', all heads: what the rig says of them jointly, else heads
/// and lenses by themselves; σ of zeros and scales of encoders where the rig's covariance holds these.
[[nodiscard]] Eigen::MatrixXd joint_covariance(const Rig& rig);

/// The errors of a rig whose clocks are right to σ_clock each. Directions that move no pixel are omitted: those
/// kept leave 0.01 px RMS at most over a working space of 0.5 to 12 m, and are at most max_rig_errors.
[[nodiscard]] RigUncertainty rig_uncertainty(const Rig& rig, double sigma_clock_s = 0.0);

/// ∂ pixel / ∂ u for the head of `factor` at these readings and a point with that velocity: a clock that lags by δ
/// shows the target where it is δ later. `lens`: the intrinsics that it is seen under, where these are not its own.
/// None where the camera does not see it.
[[nodiscard]] std::optional<RigErrorEffect> rig_error_effect(const Eigen::MatrixXd& factor, const TurnedHead& turned,
                                                             const Camera& camera,
                                                             const Eigen::Vector3d& point_in_world,
                                                             const Eigen::Vector3d& velocity_in_world,
                                                             const std::optional<ObservationLens>& lens = {});

ALIDADE_PUBLIC_END

/// ∂ pixel / ∂ the rows of a factor: the head's parameters, its lens', the delay of its clock.
using RigParamEffect = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, num_head_params + 17>;

/// The same as rig_error_effect() by each parameter of the head.
[[nodiscard]] std::optional<RigParamEffect> rig_param_effect(const TurnedHead& turned, const Camera& camera,
                                                             const Eigen::Vector3d& point_in_world,
                                                             const Eigen::Vector3d& velocity_in_world,
                                                             const std::optional<ObservationLens>& lens = {});

}  // namespace alidade
