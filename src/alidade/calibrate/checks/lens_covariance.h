#pragma once

#include "alidade/calibrate/solve/bundle.h"
#include "alidade/estimation/cluster_covariance.h"

namespace alidade {

/// Covariance of all parameters of a lens, in their order; a parameter that is held has zero rows.
struct LensCovariance {
  Eigen::MatrixXd stated;      ///< Views are its clusters, as the corners of one share errors.
  Eigen::MatrixXd model;       ///< As if every corner erred by itself.
  ClusterCovariance clusters;  ///< What tells the two apart, one value per parameter.
};

/// `noise_variance`: of the whitened residuals. `result` must have its covariance; its poses' follow what is stated.
[[nodiscard]] LensCovariance lens_covariance(const BundleProblem& problem, double noise_variance, BundleResult& result);

}  // namespace alidade
