#pragma once

#include <vector>

#include "alidade/calibrate/solve/bundle.h"
#include "alidade/estimation/cluster_covariance.h"

namespace alidade {

/// The influence of each view on the free lens parameters, pose eliminated, board shape estimated: the
/// clusters of their covariance, for whitened_cluster_covariance(). `result` must have its covariance; L Lᵀ is its
/// block of the free lens parameters. Steps of views without a pose are zero.
[[nodiscard]] std::vector<ClusterStep> view_steps(const BundleProblem& problem, const BundleResult& result,
                                                  const Eigen::MatrixXd& L);

/// Clusters by board corner: the influence of each corner in all views, and the part due to independent errors.
struct CornerSteps {
  std::vector<ClusterStep> steps;  ///< Whitened, without shares: the corners of a board are alike.
  Eigen::MatrixXd by_themselves;   ///< Their scatter if the errors of a corner in different views were independent.
};

/// A deformed board displaces the same corner in the same way in every photo. With many views a sample suffices,
/// because what all of them share shows in each. No steps if every point of the board is free.
[[nodiscard]] CornerSteps corner_steps(const BundleProblem& problem, const BundleResult& result,
                                       const Eigen::MatrixXd& L);

}  // namespace alidade
