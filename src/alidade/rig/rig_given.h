#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/rig/rig.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

inline constexpr double ordinary_scale = 0.005;  ///< σ of an encoder's scale of which nothing is known.

/// Derivatives of a view's whitened residuals by what is given: its lens, the board's size (relative), the scales; and
/// by the readings and the pose of its head's base.
struct GivenColumns {
  Eigen::MatrixXd lens;        ///< As many columns as the lens has parameters.
  Eigen::VectorXd distortion;  ///< By a radial term of third order, k1 r², added to whatever the lens has.
  Eigen::VectorXd square, pan, tilt;
  Eigen::Matrix<double, Eigen::Dynamic, 2> readings;
  Eigen::Matrix<double, Eigen::Dynamic, 6> base;
};
/// ∂ pixel / ∂ k1 of a factor 1 + k1 r² about the centre of the image, of a point in the camera seen at `px`.
[[nodiscard]] Eigen::Vector2d by_radial_term(const Eigen::VectorXd& lens, const Eigen::Vector2d& px,
                                             const Eigen::Vector3d& point_in_cam);
[[nodiscard]] GivenColumns given_columns(const RigProblem& problem, const RigState& state, std::size_t view);

/// What a rig's estimate was given — lenses, the printed square, the encoders' scales — and what it does to the
/// estimate: parameters θ that are free follow a given a by dθ/da = −H⁻¹ ∂g/∂a.
struct RigGiven {
  RigProblem wide;                     ///< The problem with the scales among the free parameters of each head.
  std::vector<Assumption> assumed;     ///< `moves` is not filled in yet.
  std::vector<Eigen::VectorXd> moved;  ///< By wide parameters: what the error supposed (or its σ) does.
  Eigen::MatrixXd cov;                 ///< Of the wide parameters, of all that is given with a σ.
  Eigen::MatrixXd cov_lenses;          ///< Of the parameters of all heads' lenses, head by head, as given.
  Eigen::MatrixXd cov_with_lenses;     ///< Of the wide parameters with these.
};
/// `cov`: of the free parameters of the problem by the model. Heads whose cameras are one file share its errors.
[[nodiscard]] RigGiven rig_given(const RigProblem& problem, const SolvedRig& solved, const Eigen::MatrixXd& cov,
                                 const std::vector<double>& weights, const RigConfig& config);

/// σ of a fixed scale, including the effect of an encoder's error within a turn; none: none was given.
[[nodiscard]] std::optional<double> counted_sigma_scale(const RigConfig& config);

/// The free parameters' covariance where the wide ones' stands.
[[nodiscard]] Eigen::MatrixXd widened(const RigProblem& problem, const RigProblem& wide, const Eigen::MatrixXd& cov);

}  // namespace alidade
