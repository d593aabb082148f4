#pragma once

#include <vector>

#include "alidade/calibrate/solve/bundle.h"
#include "alidade/estimation/cluster_covariance.h"

namespace alidade {

/// What each view alone does to the free lens parameters, its pose eliminated, the board's shape taken along: the
/// clusters of their covariance. `result` must have its covariance; views without one stand as zeros.
[[nodiscard]] std::vector<ClusterStep> view_steps(const BundleProblem& problem, const BundleResult& result);

}  // namespace alidade
