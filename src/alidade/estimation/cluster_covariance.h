#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// What one independent cluster of measurements (a photo, a shot, a block of time) does to the estimate, in the
/// parameters whose covariance is requested: H = Σ A + priors is the information of all shared parameters (the
/// clusters' own eliminated), A and g = Σ Jᵀr the cluster's part of it and of the gradient at the optimum, r whitened.
struct ClusterStep {
  Eigen::VectorXd step;    ///< H⁻¹ g, of the requested parameters.
  Eigen::MatrixXd spread;  ///< H⁻¹ A H⁻¹, of the same: the covariance of `step` at the true parameters.
  /// H⁻¹ A H⁻¹ A H⁻¹, of the same, over all shared parameters: by how much the fit to the cluster itself lessens that.
  /// May be omitted where all shared parameters are requested.
  Eigen::MatrixXd taken = {};
};

/// The step of a cluster where all shared parameters are requested: `inverse` is H⁻¹.
[[nodiscard]] ClusterStep cluster_step(const Eigen::MatrixXd& inverse, const Eigen::MatrixXd& information,
                                       const Eigen::VectorXd& gradient);

/// Covariance of an estimate whose errors are shared within clusters, and why it differs from the model's.
struct ClusterCovariance {
  Eigen::MatrixXd cov;                 ///< To be stated; nowhere below the model's.
  Eigen::VectorXd inflation;           ///< σ over the model's σ, one per parameter; 1 for a fixed parameter.
  Eigen::VectorXd degrees_of_freedom;  ///< Of each variance (Satterthwaite); infinite where it is the model's.
  double design_effect = 1.0;          ///< Variance over the model's, in the mean over all directions.
  double shrinkage = 1.0;              ///< λ: 0: the clusters' own scatter by direction; 1: the design effect in all.
  std::vector<double> z2;  ///< One per cluster: its squared score over what the model expects; 1 in the mean if true.

  static constexpr std::size_t min_clusters = 3;

  /// Largest inflation of σ over the parameters.
  [[nodiscard]] double largest_inflation() const { return inflation.size() > 0 ? inflation.maxCoeff() : 1.0; }
};

/// Cluster-robust covariance. `inverse` is H⁻¹ of the requested parameters, `noise_variance` the variance s² of the
/// whitened residuals by their own degrees of freedom: s² H⁻¹ is the model's covariance. Parameters with a zero
/// diagonal are fixed. Fewer than `min_clusters` clusters determine nothing: the model's covariance is returned.
///
/// In parameters in which H⁻¹ = 1 a cluster has the share h = C Cᵀ of the information and the step d; by the model the
/// covariance of y = C⁻¹ d is s² (1 − m), m the leverage of the whole fit. x = C (1 − m)^(−1/2) y/s makes the scatter
/// W = Σ x xᵀ unbiased for 1 (CR2); along directions in which a cluster contradicts the others beyond chance it is
/// C (1 − m)⁻¹ y/s: what its deletion changes (CR3, the jackknife). The excess of W over 1 is used as far as the
/// design effect c = tr W / tr 1 departs from 1 beyond chance, shrunk towards (c − 1)·1 by its degrees of freedom,
/// added to the model's, and widened by ν/(ν − 2), the variance of a t distribution of as many degrees of freedom, with
/// which the 2σ interval holds for few clusters, too. Liang & Zeger, Biometrika 73, 1986; Bell & McCaffrey, Survey
/// Methodology 28(2), 2002; Imbens & Kolesár, Rev. Econ. Stat. 98(4), 2016. docs/maths/honest-sigma.md.
[[nodiscard]] ClusterCovariance cluster_covariance(const Eigen::MatrixXd& inverse, double noise_variance,
                                                   std::span<const ClusterStep> clusters);

/// The same for clusters in parameters in which the information is 1: H⁻¹ = L Lᵀ, their steps are L⁻¹ d, their spreads
/// L⁻¹ … L⁻ᵀ; without a spread they have equal shares. An estimator that makes them so has less to multiply. No
/// parameter is fixed.
[[nodiscard]] ClusterCovariance whitened_cluster_covariance(const Eigen::MatrixXd& L, double noise_variance,
                                                            std::vector<ClusterStep> clusters);

/// The check "photos agree" ("shots agree", …): by how much the clusters' scatter raises σ over what the noise of
/// single measurements gives. `cluster` is the word for one: "photo"; `causes`: "blur, rolling shutter, or the lens
/// model".
[[nodiscard]] Check clusters_agree(const ClusterCovariance& covariance, const std::string& cluster,
                                   const std::string& causes, const std::string& figure);

ALIDADE_PUBLIC_END
}  // namespace alidade
