#pragma once

#include <vector>

#include "alidade/calibrate/solve/bundle.h"
#include "alidade/estimation/cluster_covariance.h"

namespace alidade {

/// What each view alone does to the free lens parameters, its pose eliminated, the board's shape taken along: the
/// clusters of their covariance, for whitened_cluster_covariance(). `result` must have its covariance, of which L Lᵀ is
/// the free lens parameters' block; views without a pose stand as zeros.
[[nodiscard]] std::vector<ClusterStep> view_steps(const BundleProblem& problem, const BundleResult& result,
                                                  const Eigen::MatrixXd& L);

/// The other way: what each corner of the board does in all views together. A board that is not as it was taken to be
/// moves the same corner alike in every photo. Whitened, without shares: those of the board's corners are alike. Of
/// many views some will do, as what is shared by all of them shows in each. Empty where every point of the board is
/// free.
[[nodiscard]] std::vector<ClusterStep> corner_steps(const BundleProblem& problem, const BundleResult& result,
                                                    const Eigen::MatrixXd& L);

}  // namespace alidade
