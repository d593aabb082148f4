#pragma once

#include <span>
#include <string>
#include <utility>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// How the stated σ came about: by how much the clusters' scatter raised the model's, and how sure that is. `given`:
/// the names of the parameters that are estimated, each with its index in the covariance.
[[nodiscard]] JsonValue sigma_values(std::span<const std::pair<std::string, Eigen::Index>> given,
                                     const ClusterCovariance& clusters);

}  // namespace alidade
