#include "alidade/calibrate/checks/lens_covariance.h"

#include <limits>
#include <utility>

#include "alidade/calibrate/solve/view_steps.h"

namespace alidade {
namespace {

/// A covariance of the free lens parameters among all of the lens.
Eigen::MatrixXd among_all(const Eigen::MatrixXd& of_free, const std::vector<int>& free, Eigen::Index num_params) {
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(num_params, num_params);
  all(free, free) = of_free;
  return all;
}

/// Likewise what the clusters say; parameters that are held have no inflation.
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

}  // namespace

LensCovariance lens_covariance(const BundleProblem& problem, double noise_variance, BundleResult& result) {
  const std::vector<int>& free = problem.free_lens;
  const auto num_free = static_cast<Eigen::Index>(free.size());
  const Eigen::Index num_params = params(result.state.lens).size();
  const Eigen::MatrixXd inverse = result.cov.topLeftCorner(num_free, num_free);
  ClusterCovariance clusters = cluster_covariance(inverse, noise_variance, view_steps(problem, result));
  follow_lens(clusters.cov / noise_variance - inverse, result);
  return {among_all(clusters.cov, free, num_params), among_all(noise_variance * inverse, free, num_params),
          among_all(std::move(clusters), free, num_params)};
}

}  // namespace alidade
