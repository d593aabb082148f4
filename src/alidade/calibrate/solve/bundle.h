#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "alidade/calibrate/config.h"
#include "alidade/calibrate/solve/view_arrays.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace alidade {

struct NormalEquations;
class PoseFactor;

/// The state that is estimated jointly: lens, poses, board points.
struct BundleState {
  Lens lens;
  std::vector<Rigid3> cam_from_board;
  std::vector<Eigen::Vector3d> board_points;  ///< [m]
};

/// Constants of a solve.
struct BundleProblem {
  std::span<const ViewArrays> views;
  std::vector<int> free_lens;         ///< Indices of the estimated lens parameters.
  Eigen::VectorXd prior_value;        ///< One per lens parameter.
  Eigen::VectorXd prior_information;  ///< 1/σ²; 0 without a prior.
  BoardShape shape = BoardShape::flat;
  std::vector<Eigen::Vector3d> printed_points;  ///< The board as printed: gauge and initial guess of its shape. [m]
  double shape_sigma_m =
      0.0;  ///< Prior σ of a free point about the printed one; it keeps unseen points where they were.
  /// Brown: the formulas are also used beyond the fold of the radial map, where a real lens forms no image.
  bool passes_fold = false;
};

/// Start and termination of a solve.
struct BundleConfig {
  int max_iterations = 60;
  double tolerance_sigmas = 1e-3;  ///< Converged when a step moves no parameter by more of its σ.
  double first_lambda = 1e-5;      ///< Initial Marquardt damping; 0 if the initial guess is known to be close.
};

/// Result of a solve. `cov` is over the free lens parameters, then the shape (bow: 2 heights; free: x y z per point).
struct BundleResult {
  enum class Status { converged, no_convergence, singular };
  Status status = Status::singular;
  BundleState state;
  double cost = 0.0;  ///< Σ of squared whitened residuals, priors included.
  int iterations = 0;
  std::shared_ptr<const NormalEquations> equations;  ///< At the start of the last step.
  // The following are set by with_covariance().
  Eigen::MatrixXd cov;                                          ///< Inverse of the reduced normal matrix.
  std::shared_ptr<const std::vector<PoseFactor>> pose_factors;  ///< Of the equations' pose blocks.
  /// If the reduced matrix, scaled to unit diagonal, is (nearly) singular: the eigenvector of its smallest
  /// eigenvalue, that is, the unobservable direction.
  Eigen::VectorXd weakest;
};

/// Maximum-likelihood bundle adjustment by Levenberg–Marquardt. The poses are eliminated view by view (6 × 6
/// Cholesky), so time and memory are linear in the views. Triggs et al., "Bundle adjustment — a modern synthesis",
/// 2000, §6; gauge of the free board: minimal constraints, the rigid motion and scale that fit the printed board best.
[[nodiscard]] BundleResult solve_bundle(const BundleProblem& problem, BundleState start, const BundleConfig& config);

/// The same; if a Brown lens' fold stops it (steps that put a corner behind the fold are rejected, and the solve creeps
/// along the fold), it continues with the polynomial beyond it, as OpenCV does. Status no_convergence where it ends
/// with a used corner behind the fold; with more than a tenth of them there, the first result is kept.
[[nodiscard]] BundleResult solve_past_fold(BundleProblem problem, BundleState start, const BundleConfig& config);

/// The same with its covariance, from the undamped equations; status singular if they do not determine all parameters.
/// A result that has not converged is returned unchanged.
[[nodiscard]] BundleResult with_covariance(BundleResult result);

/// Covariance of each view's pose, if whitened residuals have the variance s² and lens and shape the covariance
/// `cov`: s² V⁻¹ + (V⁻¹ Wᵀ) cov (V⁻¹ Wᵀ)ᵀ.
[[nodiscard]] std::vector<Eigen::Matrix<double, 6, 6>> pose_covariances(const BundleResult& result,
                                                                        double noise_variance,
                                                                        const Eigen::MatrixXd& cov);

/// Residual (prediction − observation) [px] of every corner of a view, not whitened; NaN if it cannot be projected.
[[nodiscard]] std::vector<Eigen::Vector2d> residuals_px(const BundleState& state, std::size_t view_index,
                                                        const ViewArrays& view);

/// Pose of one view with lens and board fixed, from an initial guess. None if it does not converge.
[[nodiscard]] std::optional<Rigid3> refine_pose(const Lens& lens, const std::vector<Eigen::Vector3d>& board_points,
                                                const ViewArrays& view, const Rigid3& cam_from_board);

}  // namespace alidade
