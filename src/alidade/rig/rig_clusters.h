#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// What one view says once the correction of its reading is eliminated: its residuals in an orthonormal basis of what a
/// move of its board can do to them, six components or fewer.
struct ViewEquations {
  Eigen::MatrixXd Q;        ///< The basis: rows of the view by k.
  Eigen::VectorXd y;        ///< Qᵀ r.
  Eigen::MatrixXd G;        ///< Qᵀ J by the shared parameters, the board following: k by their number.
  Eigen::MatrixXd K_board;  ///< Qᵀ J by the board: k × 6.
};
/// None where the camera does not see a corner.
[[nodiscard]] std::optional<ViewEquations> view_equations(const RigProblem& problem, const SolvedRig& solved,
                                                          std::size_t view);

/// What each used view does to the shared parameters, of covariance `cov` by the model. The boards take degrees of
/// freedom from the views' residuals as the heads do; the steps are made larger by what the boards take.
[[nodiscard]] std::vector<ClusterStep> view_cluster_steps(const RigProblem& problem, const SolvedRig& solved,
                                                          const Eigen::MatrixXd& cov, std::span<const double> weights);

}  // namespace alidade
