#include "alidade/calibrate/checks/lens_covariance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "alidade/calibrate/solve/view_steps.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

/// A covariance of the free lens parameters among all of the lens.
Eigen::MatrixXd among_all(const Eigen::MatrixXd& of_free, const std::vector<int>& free, Eigen::Index num_params) {
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(num_params, num_params);
  all(free, free) = of_free;
  return all;
}

/// Likewise from the clusters; fixed parameters have no inflation.
ClusterCovariance among_all(ClusterCovariance of_free, const std::vector<int>& free, Eigen::Index num_params) {
  Eigen::VectorXd inflation = Eigen::VectorXd::Ones(num_params);
  Eigen::VectorXd dof = Eigen::VectorXd::Constant(num_params, std::numeric_limits<double>::infinity());
  inflation(free) = of_free.inflation;
  dof(free) = of_free.degrees_of_freedom;
  of_free.cov = among_all(of_free.cov, free, num_params);
  of_free.inflation = inflation;
  of_free.degrees_of_freedom = dof;
  return of_free;
}

void raise(const Eigen::MatrixXd& by, ClusterCovariance& clusters) {
  clusters.inflation.array() *= (1.0 + by.diagonal().array() / clusters.cov.diagonal().array()).sqrt();
  clusters.cov += by;
}

/// What corners share with themselves from view to view, less what single corners of single views would.
Eigen::MatrixXd shared_by_corners(const Eigen::MatrixXd& L, double noise_variance, CornerSteps corners) {
  const Llt both(corners.by_themselves / noise_variance);
  if (corners.steps.empty() || !both.is_positive()) return Eigen::MatrixXd::Zero(L.rows(), L.rows());
  for (ClusterStep& corner : corners.steps) corner.step = both.whitened(corner.step);
  const Eigen::MatrixXd to_both = L * both.lower();
  const ClusterCovariance shared = whitened_cluster_covariance(to_both, noise_variance, std::move(corners.steps));
  return shared.cov - noise_variance * to_both * to_both.transpose();
}

/// The part of `more` that is above `seen`, by direction: a lens model's misfit shows both ways, and is counted once.
Eigen::MatrixXd part_above(const Eigen::MatrixXd& more, const Eigen::MatrixXd& seen, const Eigen::MatrixXd& L) {
  const auto lower = L.triangularView<Eigen::Lower>();
  const Eigen::MatrixXd half = lower.solve(more - seen);
  const SymmetricEigen above = symmetric_eigen(lower.solve(half.transpose()));
  const Eigen::MatrixXd to_lens = L * above.vectors;
  return to_lens * above.values.cwiseMax(0.0).asDiagonal() * to_lens.transpose();
}

/// Adds the spread of the minima about the one that is stated. Returns their weights.
std::vector<double> count_others(const BundleProblem& problem, double noise_variance, const BundleResult& result,
                                 std::span<const BundleResult> others, ClusterCovariance& clusters) {
  std::vector<double> weights;
  double sum = 1.0;
  for (const BundleResult& other : others) {
    const double excess = std::max(0.0, other.cost - result.cost) / noise_variance;
    weights.push_back(std::exp(-0.5 * excess / std::max(1.0, clusters.design_effect)));
    sum += weights.back();
  }
  for (std::size_t k = 0; k < others.size(); ++k) {
    weights[k] /= sum;
    const Eigen::VectorXd away = (params(others[k].state.lens) - params(result.state.lens))(problem.free_lens);
    raise(weights[k] * away * away.transpose(), clusters);
  }
  return weights;
}

}  // namespace

LensCovariance lens_covariance(const BundleProblem& problem, double noise_variance,
                               std::span<const BundleResult> others, const BundleResult& result) {
  const std::vector<int>& free = problem.free_lens;
  const auto num_free = static_cast<Eigen::Index>(free.size());
  const Eigen::Index num_params = params(result.state.lens).size();
  const Eigen::MatrixXd inverse = result.cov.topLeftCorner(num_free, num_free);
  const Llt llt(inverse);
  ClusterCovariance clusters;
  if (llt.is_positive()) {
    const Eigen::MatrixXd L = llt.lower();
    clusters = whitened_cluster_covariance(L, noise_variance, view_steps(problem, result, L));
    const Eigen::MatrixXd by_corners = shared_by_corners(L, noise_variance, corner_steps(problem, result, L));
    raise(part_above(by_corners, clusters.cov - noise_variance * inverse, L), clusters);
  } else {
    clusters = cluster_covariance(inverse, noise_variance, {});
  }
  std::vector<double> weights = count_others(problem, noise_variance, result, others, clusters);
  return {among_all(clusters.cov, free, num_params), among_all(noise_variance * inverse, free, num_params),
          among_all(std::move(clusters), free, num_params), std::move(weights)};
}

}  // namespace alidade
