#pragma once

#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/rangefinder/solve/refine_all.h"

namespace alidade {

/// Gradient and information of three errors that a shot may have: of the reading [m], of the spot in u and in v [px].
struct ErrorScore {
  Eigen::Vector3d s = Eigen::Vector3d::Zero();  ///< ∂cost/2.
  Eigen::Matrix3d I = Eigen::Matrix3d::Zero();  ///< ∂²cost/2.
  Eigen::Matrix<double, 3, Eigen::Dynamic> by_common;
};

/// Contribution of one shot: its part A of the information and g = Jᵀr of the gradient, the board's pose eliminated.
struct ReducedShot {
  std::size_t index = 0;  ///< In the list of the problem.
  bool has_corners = false;
  Eigen::MatrixXd A;
  Eigen::VectorXd g;
  ErrorScore errors;
  ErrorScore bend;  ///< With respect to the heights of the board: BoardBend. [m]
};

/// Normal equations at a solution, shot by shot, including fixed parameters: the six parameters of the beam [origin m,
/// direction rad, scale], then those of the lens listed in `lens`: fx, fy, cx, cy, distortion, and what was free.
struct ReducedSystem {
  std::vector<int> lens;
  std::vector<ReducedShot> shots;
  Eigen::MatrixXd H;  ///< Σ A plus the information of the lens prior.

  [[nodiscard]] static Eigen::Index of_beam(int parameter) { return parameter; }
  [[nodiscard]] Eigen::Index of_lens(int parameter) const;
  /// Indices of the estimated parameters: the first `num_beam`, and those of the lens in this list.
  [[nodiscard]] std::vector<Eigen::Index> places(int num_beam, const std::vector<int>& free_lens) const;
  /// ∂²cost/2 by all parameters and the logarithm of the side of the boards' squares, poses eliminated. A scene scaled
  /// as a whole, readings included, looks the same: the column of the square is minus that of origin and scale. Shots
  /// with a given plane do not depend on the square.
  [[nodiscard]] Eigen::VectorXd square_column(const Beam& beam) const;
};

/// At `state`; `lens_prior`: the prior if the lens was free, one without parameters if it was fixed. Shots without
/// residuals are omitted.
[[nodiscard]] ReducedSystem reduced_system(const BeamProblem& problem, const LensPrior& lens_prior,
                                           const CommonState& state);

/// The shots as clusters for the parameters at indices `places`, whose model covariance is `inverse`.
[[nodiscard]] std::vector<ClusterStep> shot_clusters(const ReducedSystem& system,
                                                     const std::vector<Eigen::Index>& places,
                                                     const Eigen::MatrixXd& inverse);

}  // namespace alidade
