#pragma once

#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/rangefinder/solve/refine_all.h"

namespace alidade {

/// The same by three errors that a shot may have, as of the reading [m], of the spot in u and in v [px].
struct ErrorScore {
  Eigen::Vector3d s = Eigen::Vector3d::Zero();  ///< ∂cost/2.
  Eigen::Matrix3d I = Eigen::Matrix3d::Zero();  ///< ∂²cost/2.
  Eigen::Matrix<double, 3, Eigen::Dynamic> by_common;
};

/// What one shot brings: its part A of the information and g = Jᵀr of the gradient, the board's pose eliminated.
struct ReducedShot {
  std::size_t index = 0;  ///< In the problem's list.
  bool has_corners = false;
  Eigen::MatrixXd A;
  Eigen::VectorXd g;
  ErrorScore errors;
  ErrorScore bend;  ///< By heights of the board: BoardBend. [m]
};

/// Normal equations at a solution, shot by shot, also of what was fixed there: the beam's six parameters [origin m,
/// direction rad, scale], then those of the lens that `lens` names: fx, fy, cx, cy, its distortion, and what was free.
struct ReducedSystem {
  std::vector<int> lens;
  std::vector<ReducedShot> shots;
  Eigen::MatrixXd H;  ///< Σ A and what the lens' prior says.

  [[nodiscard]] static Eigen::Index of_beam(int parameter) { return parameter; }
  [[nodiscard]] Eigen::Index of_lens(int parameter) const;
  /// Where the parameters that were estimated stand: the first `num_beam`, and of the lens those of the list.
  [[nodiscard]] std::vector<Eigen::Index> places(int num_beam, const std::vector<int>& free_lens) const;
  /// ∂²cost/2 by all and the logarithm of the length of the boards' squares, poses eliminated. A world that is larger
  /// as a whole, readings and all, looks the same: the square's column is minus that of origin and scale. Shots whose
  /// plane was given do not follow the square.
  [[nodiscard]] Eigen::VectorXd square_column(const Beam& beam) const;
};

/// At `state`; `lens_prior`: the lens' prior where the lens was free, one without parameters where it was fixed. Shots
/// that have nothing to compare there are omitted.
[[nodiscard]] ReducedSystem reduced_system(const BeamProblem& problem, const LensPrior& lens_prior,
                                           const CommonState& state);

/// The shots as clusters of the parameters at indices `places`, whose covariance by the model is `inverse`.
[[nodiscard]] std::vector<ClusterStep> shot_clusters(const ReducedSystem& system,
                                                     const std::vector<Eigen::Index>& places,
                                                     const Eigen::MatrixXd& inverse);

}  // namespace alidade
