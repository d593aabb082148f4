#include <Eigen/Cholesky>

#include "alidade/localize/path/path_system.h"

// What of a path's covariance is its shape's, where no measurement says where and how large the world is.

namespace alidade {
namespace {

using GaugeMatrix = Eigen::Matrix<double, 6, 7>;

Eigen::Matrix<double, 3, 7> moved_place(const Eigen::Vector3d& away) {
  Eigen::Matrix<double, 3, 7> G;
  G << Eigen::Matrix3d::Identity(), -cross_matrix(away), away;
  return G;
}

}  // namespace

/// Errors are what is left after the best alignment (W. Baarda, "S-Transformations and Criterion Matrices", 1973): of
/// positions, by a motion of the world and, where its unit is a supposed one, by its size. Rotations count as much as
/// positions a hundredth of the path apart: of a path on a line they alone determine how it is rolled about it.
void PathSmoother::align(const SmootherSystem& system, const Eigen::MatrixXd& considered,
                         PoseChain::Spread& spread) const {
  if (problem_.gauge == PathGauge::fixed) return;
  const int num_free = problem_.gauge == PathGauge::similarity ? 7 : 6;
  const std::size_t num = state_.poses.size();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Rigid3& pose : state_.poses) centre += pose.translation / static_cast<double>(num);
  double extent2 = 0.0;
  for (const Rigid3& pose : state_.poses)
    extent2 += (pose.translation - centre).squaredNorm() / static_cast<double>(num);
  constexpr double rotation_share = 1e-4;
  std::vector<Eigen::MatrixXd> G, W;
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(num_free, num_free);
  for (const Rigid3& pose : state_.poses) {
    GaugeMatrix by = GaugeMatrix::Zero();
    by.topRows<3>() = moved_place(pose.translation - centre);
    by.block<3, 3>(3, 3) = pose.rotation.toRotationMatrix().transpose();
    G.push_back(by.leftCols(num_free));
    W.push_back(G.back());
    W.back().bottomRows<3>() *= rotation_share * extent2;
    N += W.back().transpose() * G.back();
  }
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(N);
  if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 0.0)) return;
  PoseChain::Columns Z = system.chain.solve(W, num_solved());  // covariance with the sums that align
  Eigen::MatrixXd given = Eigen::MatrixXd::Zero(spread.J.front().cols(), num_free);
  for (std::size_t k = 0; k < num; ++k) given += spread.J[k].transpose() * W[k];
  const Eigen::MatrixXd moved_by_given = ldlt.solve(given.transpose());
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(num_free, num_free);
  for (std::size_t k = 0; k < num; ++k) {
    Z.poses[k] += spread.J[k] * considered * given;
    sums += W[k].transpose() * Z.poses[k];
  }
  const Eigen::MatrixXd cov = ldlt.solve(ldlt.solve(sums).transpose());
  const auto aligned_cov = [&](const Eigen::MatrixXd& P, const Eigen::MatrixXd& z, const Eigen::MatrixXd& g) {
    const Eigen::MatrixXd across = g * ldlt.solve(z.transpose());
    const Eigen::MatrixXd out = P - across - across.transpose() + g * cov * g.transpose();
    return Eigen::MatrixXd(0.5 * (out + out.transpose()));
  };
  for (std::size_t k = 0; k < num; ++k) {
    spread.cov[k] = aligned_cov(spread.cov[k], Z.poses[k], G[k]);
    spread.J[k] -= G[k] * moved_by_given;
  }
  for (std::size_t i = 0; i < state_.points.size(); ++i) {
    if (!lives_[i]) continue;
    const Eigen::MatrixXd z = Z.points[i] + spread.point_J[i] * considered * given;
    spread.point_cov[i] =
        aligned_cov(spread.point_cov[i], z, moved_place(state_.points[i] - centre).leftCols(num_free));
  }
}

}  // namespace alidade
