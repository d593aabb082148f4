#pragma once

#include <span>
#include <string>
#include <utility>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Derivation of the stated σ: the factor by which the clusters' scatter raised the model's, and its certainty.
/// `given`: the names of the estimated parameters, each with its index in the covariance.
[[nodiscard]] JsonValue sigma_values(std::span<const std::pair<std::string, Eigen::Index>> given,
                                     const ClusterCovariance& clusters);

}  // namespace alidade
