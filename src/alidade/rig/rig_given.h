#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/rig/rig.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

inline constexpr double ordinary_scale = 0.005;  ///< σ of an encoder's scale if nothing is known of it.

/// Derivatives of a view's whitened residuals with respect to given quantities: its lens, the board's size (relative),
/// the scales; and to the readings and the pose of its head's base.
struct GivenColumns {
  Eigen::MatrixXd lens;        ///< One column per lens parameter.
  Eigen::VectorXd distortion;  ///< With respect to a radial term of third order, k1 r², in addition to the lens.
  Eigen::VectorXd square, pan, tilt;
  Eigen::Matrix<double, Eigen::Dynamic, 2> readings;
  Eigen::Matrix<double, Eigen::Dynamic, 6> base;
};
/// ∂ pixel / ∂ k1 of a factor 1 + k1 r² about the image centre, for a point in the camera frame seen at `px`.
[[nodiscard]] Eigen::Vector2d by_radial_term(const Eigen::VectorXd& lens, const Eigen::Vector2d& px,
                                             const Eigen::Vector3d& point_in_cam);
[[nodiscard]] GivenColumns given_columns(const RigProblem& problem, const RigState& state, std::size_t view);

/// The given quantities of a rig's estimate — lenses, the printed square, the encoders' scales — and their effect on
/// it: free parameters θ follow a given a by dθ/da = −H⁻¹ ∂g/∂a.
struct RigGiven {
  RigProblem wide;                     ///< The problem with the scales among the free parameters of each head.
  std::vector<Assumption> assumed;     ///< `moves` is not filled in yet.
  std::vector<Eigen::VectorXd> moved;  ///< In wide parameters: effect of the assumed error (or its σ).
  Eigen::MatrixXd cov;                 ///< Of the wide parameters, due to everything given with a σ.
  Eigen::MatrixXd cov_lenses;          ///< Of the parameters of all heads' lenses, head by head, as given.
  Eigen::MatrixXd cov_with_lenses;     ///< Cross-covariance of the wide parameters with these.
};
/// `cov`: of the free parameters of the problem, by the model. Heads with the same camera file share its errors.
[[nodiscard]] RigGiven rig_given(const RigProblem& problem, const SolvedRig& solved, const Eigen::MatrixXd& cov,
                                 const std::vector<double>& weights, const RigConfig& config);

/// σ of a fixed scale, including the effect of an encoder's error within a revolution; none: none was given.
[[nodiscard]] std::optional<double> counted_sigma_scale(const RigConfig& config);

/// The covariance of the free parameters, embedded in that of the wide ones.
[[nodiscard]] Eigen::MatrixXd widened(const RigProblem& problem, const RigProblem& wide, const Eigen::MatrixXd& cov);

}  // namespace alidade
