#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Effect of one independent cluster of measurements (a photo, a shot, a block of time) on the estimate, in the
/// requested parameters: H = Σ A + priors is the information of all shared parameters (the clusters' own eliminated), A
/// and g = Σ Jᵀr the cluster's part of it and of the gradient at the optimum, with r whitened.
struct ClusterStep {
  Eigen::VectorXd step;    ///< H⁻¹ g, for the requested parameters.
  Eigen::MatrixXd spread;  ///< H⁻¹ A H⁻¹, for these: the covariance of `step` at the true parameters.
  /// H⁻¹ A H⁻¹ A H⁻¹, for these, over all shared parameters: the part of `spread` that the fit to the cluster itself
  /// removes. It may be omitted if all shared parameters are requested.
  Eigen::MatrixXd taken = {};
};

/// The step of a cluster if all shared parameters are requested; `inverse` is H⁻¹.
[[nodiscard]] ClusterStep cluster_step(const Eigen::MatrixXd& inverse, const Eigen::MatrixXd& information,
                                       const Eigen::VectorXd& gradient);

/// Covariance of an estimate whose errors are shared within clusters, and how it differs from the model's.
struct ClusterCovariance {
  Eigen::MatrixXd cov;                 ///< The covariance to report; nowhere below the model's.
  Eigen::VectorXd inflation;           ///< σ over the model's σ, one per parameter; 1 for a fixed parameter.
  Eigen::VectorXd degrees_of_freedom;  ///< For each variance (Satterthwaite); infinite where it is the model's.
  double design_effect = 1.0;          ///< Variance over the model's, averaged over all directions.
  double shrinkage = 1.0;              ///< λ. 0: the clusters' own scatter by direction; 1: the design effect in all.
  std::vector<double> z2;  ///< One per cluster: squared score over its expectation; mean 1 for a true model.

  static constexpr std::size_t min_clusters = 3;

  /// Largest inflation of σ over the parameters.
  [[nodiscard]] double largest_inflation() const { return inflation.size() > 0 ? inflation.maxCoeff() : 1.0; }
};

/// Cluster-robust covariance. `inverse` is H⁻¹ of the requested parameters; `noise_variance` is the variance s² of the
/// whitened residuals, by their own degrees of freedom, so that s² H⁻¹ is the model's covariance. Parameters with a
/// zero diagonal are fixed. With fewer than `min_clusters` clusters the model's covariance is returned.
///
/// In parameters for which H⁻¹ = 1, a cluster has the share h = C Cᵀ of the information and the step d; under the model
/// the covariance of y = C⁻¹ d is s² (1 − m), where m is the leverage of the whole fit. x = C (1 − m)^(−1/2) y/s makes
/// the scatter W = Σ x xᵀ unbiased for 1 (CR2); along directions in which a cluster contradicts the others beyond
/// chance it is C (1 − m)⁻¹ y/s, the change by its deletion (CR3, the jackknife). The excess of W over 1 is used as far
/// as the design effect c = tr W / tr 1 departs from 1 beyond chance. It is shrunk towards (c − 1)·1 by its degrees of
/// freedom, added to the model's, and widened by ν/(ν − 2), the variance of a t distribution with ν degrees of freedom,
/// so that the 2σ interval holds for few clusters, too. Liang & Zeger, Biometrika 73, 1986; Bell & McCaffrey, Survey
/// Methodology 28(2), 2002; Imbens & Kolesár, Rev. Econ. Stat. 98(4), 2016. docs/maths/honest-sigma.md.
[[nodiscard]] ClusterCovariance cluster_covariance(const Eigen::MatrixXd& inverse, double noise_variance,
                                                   std::span<const ClusterStep> clusters);

/// The same for clusters in parameters in which the information is 1: with H⁻¹ = L Lᵀ, their steps are L⁻¹ d and their
/// spreads L⁻¹ … L⁻ᵀ; without a spread they have equal shares. It saves multiplications for an estimator that provides
/// them in this form. No parameter is fixed.
[[nodiscard]] ClusterCovariance whitened_cluster_covariance(const Eigen::MatrixXd& L, double noise_variance,
                                                            std::vector<ClusterStep> clusters);

/// The check "photos agree" ("shots agree", …): the factor by which the clusters' scatter raises σ above what the noise
/// of single measurements gives. `cluster` is the word for one cluster: "photo"; `causes`, for example: "blur, rolling
/// shutter, or the lens model".
[[nodiscard]] Check clusters_agree(const ClusterCovariance& covariance, const std::string& cluster,
                                   const std::string& causes, const std::string& figure);

ALIDADE_PUBLIC_END
}  // namespace alidade
