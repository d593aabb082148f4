#pragma once

#include "alidade/calibrate/solve/bundle.h"
#include "alidade/estimation/cluster_covariance.h"

namespace alidade {

/// Covariance of all parameters of a lens, in their order; a fixed parameter has zero rows.
struct LensCovariance {
  Eigen::MatrixXd stated;       ///< Views are its clusters, as the corners of one share errors.
  Eigen::MatrixXd model;        ///< As if every corner erred by itself.
  ClusterCovariance clusters;   ///< The difference of the two, one value per parameter.
  std::vector<double> weights;  ///< Of the other minima: how likely each is, all of them and `result` being 1.
};

/// `noise_variance`: of the whitened residuals. `result` must have its covariance.
/// `others`: minima of the cost that lie elsewhere. Each is as likely as exp(−Δ/(2 c s²)) says, Δ by what its cost is
/// greater, c the design effect, and what is stated reaches to it by that weight.
[[nodiscard]] LensCovariance lens_covariance(const BundleProblem& problem, double noise_variance,
                                             std::span<const BundleResult> others, const BundleResult& result);

}  // namespace alidade
