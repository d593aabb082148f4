#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// Equations of one view with the correction of its reading eliminated: its residuals in an orthonormal basis of the
/// directions in which a motion of its board moves them, six or fewer.
struct ViewEquations {
  Eigen::MatrixXd Q;        ///< The basis: rows of the view × k.
  Eigen::VectorXd y;        ///< Qᵀ r.
  Eigen::MatrixXd G;        ///< Qᵀ J of the shared parameters, the board following: k × their number.
  Eigen::MatrixXd K_board;  ///< Qᵀ J of the board: k × 6.
};
/// None if the camera does not see a corner.
[[nodiscard]] std::optional<ViewEquations> view_equations(const RigProblem& problem, const SolvedRig& solved,
                                                          std::size_t view);

/// Influence of each used view on the shared parameters, whose model covariance is `cov`. The boards take degrees of
/// freedom from the views' residuals just as the heads do; the steps are enlarged accordingly.
[[nodiscard]] std::vector<ClusterStep> view_cluster_steps(const RigProblem& problem, const SolvedRig& solved,
                                                          const Eigen::MatrixXd& cov, std::span<const double> weights);

}  // namespace alidade
