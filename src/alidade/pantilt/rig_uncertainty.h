#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/pantilt/rig.h"
#include "alidade/public.h"

// The uncertainty of what a rig file states, in a form for estimators with considered parameters (Schmidt–Kalman).

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Maximum number of error directions that are considered; see rig_uncertainty().
inline constexpr int max_rig_errors = 32;

/// ∂ pixel / ∂ u for one observation.
using RigErrorEffect = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, max_rig_errors>;

/// Errors of a rig's heads, lenses and clocks: p = p̂ + factor[h] u, with u ~ N(0, I) common to all heads. Rows of a
/// factor: the head's parameters (head_param_names), its lens parameters (param_names), the delay of its clock [s].
struct RigUncertainty {
  std::vector<Eigen::MatrixXd> factor;  ///< One per head; empty: everything is exact.

  [[nodiscard]] int num() const { return factor.empty() ? 0 : static_cast<int>(factor.front().cols()); }
};

/// Covariance of the parameters of all heads, then of all lenses: the rig's joint covariance if known, else that of
/// heads and lenses separately; σ of encoder zeros and scales is added where the rig's covariance has zero variance.
[[nodiscard]] Eigen::MatrixXd joint_covariance(const Rig& rig);

/// The errors of a rig with σ_clock per clock. Directions that hardly move a pixel are omitted: in total they amount to
/// at most 0.01 px RMS over a working space of 0.5 to 12 m. No more than max_rig_errors are kept.
[[nodiscard]] RigUncertainty rig_uncertainty(const Rig& rig, double sigma_clock_s = 0.0);

/// ∂ pixel / ∂ u for the head of `factor` at these readings and a point with this velocity: a clock that lags by δ
/// shows the target where it is δ later. `lens`: the intrinsics of the observation, if they are not those of `camera`.
/// None if the camera does not see the point.
[[nodiscard]] std::optional<RigErrorEffect> rig_error_effect(const Eigen::MatrixXd& factor, const TurnedHead& turned,
                                                             const Camera& camera,
                                                             const Eigen::Vector3d& point_in_world,
                                                             const Eigen::Vector3d& velocity_in_world,
                                                             const std::optional<ObservationLens>& lens = {});

ALIDADE_PUBLIC_END

/// ∂ pixel / ∂ the rows of a factor: the head's parameters, its lens parameters, the delay of its clock.
using RigParamEffect = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, num_head_params + 17>;

/// The same as rig_error_effect(), but with respect to each parameter of the head.
[[nodiscard]] std::optional<RigParamEffect> rig_param_effect(const TurnedHead& turned, const Camera& camera,
                                                             const Eigen::Vector3d& point_in_world,
                                                             const Eigen::Vector3d& velocity_in_world,
                                                             const std::optional<ObservationLens>& lens = {});

}  // namespace alidade
