#pragma once

#include "alidade/calibrate/solve/bundle.h"
#include "alidade/estimation/cluster_covariance.h"

namespace alidade {

/// Covariance of all parameters of a lens, in order; zero rows for fixed parameters.
struct LensCovariance {
  Eigen::MatrixXd stated;       ///< Clustered by view, because the corners of one view share errors.
  Eigen::MatrixXd model;        ///< For independent corner errors.
  ClusterCovariance clusters;   ///< Explains the difference of the two, one value per parameter.
  std::vector<double> weights;  ///< Probabilities of the other minima; with that of `result` they sum to 1.
};

/// `noise_variance`: of the whitened residuals. `result` must have its covariance.
/// `others`: other minima of the cost. The probability of each is proportional to exp(−Δ/(2 c s²)), with Δ the excess
/// of its cost and c the design effect, and the stated covariance extends to it with that weight.
[[nodiscard]] LensCovariance lens_covariance(const BundleProblem& problem, double noise_variance,
                                             std::span<const BundleResult> others, const BundleResult& result);

}  // namespace alidade
