#pragma once

#include <vector>

#include "alidade/calibrate/solve/bundle.h"
#include "alidade/estimation/cluster_covariance.h"

namespace alidade {

/// The influence of each view on the free lens parameters, its pose eliminated, the board's shape estimated: the
/// clusters of their covariance, for whitened_cluster_covariance(). `result` must have its covariance, of which L Lᵀ is
/// the free lens parameters' block; views without a pose stand as zeros.
[[nodiscard]] std::vector<ClusterStep> view_steps(const BundleProblem& problem, const BundleResult& result,
                                                  const Eigen::MatrixXd& L);

/// The other way: what each corner of the board does in all views together, and how much of it single corners would.
struct CornerSteps {
  std::vector<ClusterStep> steps;  ///< Whitened, without shares: those of the board's corners are alike.
  Eigen::MatrixXd by_themselves;   ///< Their scatter, were the errors of a corner in two views independent.
};

/// A board that is not as it was taken to be moves the same corner alike in every photo. Of many views some will do, as
/// what is shared by all of them shows in each. No steps where every point of the board is free.
[[nodiscard]] CornerSteps corner_steps(const BundleProblem& problem, const BundleResult& result,
                                       const Eigen::MatrixXd& L);

}  // namespace alidade
