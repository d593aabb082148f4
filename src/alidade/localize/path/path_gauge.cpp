
#include "alidade/geometry/decompositions.h"
#include "alidade/localize/map/map_frame.h"
#include "alidade/localize/path/path_system.h"

// Covariance of a path's shape, where no measurement determines position, rotation and scale of the world.

namespace alidade {
namespace {

using GaugeMatrix = Eigen::Matrix<double, 6, 7>;

/// Derivatives of a path's poses with respect to a similarity of the world, and the weights of their errors in the best
/// alignment.
struct Gauge {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  int num_free = 7;
  std::vector<Eigen::MatrixXd> G, W;  ///< By pose: derivatives, and weighted ones.
  Ldlt normal;

  [[nodiscard]] bool is_determined() const { return normal.min_pivot() > 0.0; }
  [[nodiscard]] Eigen::MatrixXd moves(const Eigen::Vector3d& point) const {
    return similarity_moves(point - centre).leftCols(num_free);
  }
};

/// Rotations are weighted like positions 1 % of the path's extent apart: for a path along a line only they determine
/// the roll about it.
Gauge gauge_of(std::span<const Rigid3> poses, int num_free) {
  const auto num = static_cast<double>(poses.size());
  Gauge gauge{.num_free = num_free};
  for (const Rigid3& pose : poses) gauge.centre += pose.translation / num;
  double extent2 = 0.0;
  for (const Rigid3& pose : poses) extent2 += (pose.translation - gauge.centre).squaredNorm() / num;
  constexpr double rotation_share = 1e-4;
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(num_free, num_free);
  for (const Rigid3& pose : poses) {
    GaugeMatrix by = GaugeMatrix::Zero();
    by.topRows<3>() = similarity_moves(pose.translation - gauge.centre);
    by.block<3, 3>(3, 3) = pose.rotation.toRotationMatrix().transpose();
    gauge.G.push_back(by.leftCols(num_free));
    gauge.W.push_back(gauge.G.back());
    gauge.W.back().bottomRows<3>() *= rotation_share * extent2;
    N += gauge.W.back().transpose() * gauge.G.back();
  }
  gauge.normal = Ldlt(N);
  return gauge;
}

/// Covariance after alignment of an error with covariance P, where the alignment's sums have covariance `of_sums`, z is
/// their cross-covariance with it, and g its derivative with respect to them.
Eigen::MatrixXd aligned_cov(const Gauge& gauge, const Eigen::MatrixXd& of_sums, const Eigen::MatrixXd& P,
                            const Eigen::MatrixXd& z, const Eigen::MatrixXd& g) {
  const Eigen::MatrixXd across = g * gauge.normal.solve_each(z.transpose());
  const Eigen::MatrixXd out = P - across - across.transpose() + g * of_sums * g.transpose();
  return 0.5 * (out + out.transpose());
}

}  // namespace

/// Errors are those after the best alignment (W. Baarda, "S-Transformations and Criterion Matrices", 1973): by a rigid
/// motion of the world and, if its unit of length is assumed, by its scale.
void PathSmoother::align(const SmootherSystem& system, const Eigen::MatrixXd& considered,
                         PoseChain::Spread& spread) const {
  if (problem_.gauge == PathGauge::fixed) return;
  const Gauge gauge = gauge_of(state_.poses, problem_.gauge == PathGauge::similarity ? 7 : 6);
  if (!gauge.is_determined()) return;
  const std::size_t num = state_.poses.size();
  PoseChain::Columns Z = system.chain.solve({gauge.W, {}}, num_solved());  // cross-covariance with the sums
  Eigen::MatrixXd given = Eigen::MatrixXd::Zero(spread.J.front().cols(), gauge.num_free);
  for (std::size_t k = 0; k < num; ++k) given += spread.J[k].transpose() * gauge.W[k];
  const Eigen::MatrixXd moved_by_given = gauge.normal.solve_each(given.transpose());
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(gauge.num_free, gauge.num_free);
  for (std::size_t k = 0; k < num; ++k) {
    Z.poses[k] += spread.J[k] * considered * given;
    sums += gauge.W[k].transpose() * Z.poses[k];
  }
  const Eigen::MatrixXd of_sums = gauge.normal.solve_each(gauge.normal.solve_each(sums).transpose());
  for (std::size_t k = 0; k < num; ++k) {
    spread.cov[k] = aligned_cov(gauge, of_sums, spread.cov[k], Z.poses[k], gauge.G[k]);
    spread.J[k] -= gauge.G[k] * moved_by_given;
  }
  for (std::size_t i = 0; i < state_.points.size(); ++i) {
    if (!lives_[i]) continue;
    const Eigen::MatrixXd z = Z.points[i] + spread.point_J[i] * considered * given;
    const Eigen::MatrixXd moves = gauge.moves(state_.points[i]);
    spread.point_cov[i] = aligned_cov(gauge, of_sums, spread.point_cov[i], z, moves);
    spread.point_J[i] -= moves * moved_by_given;
  }
}

namespace {

/// Derivatives of a map's points with respect to its frame, and the weight of each in determining it.
struct MapGauge {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  std::vector<Eigen::MatrixXd> G, W;  ///< By point of the map.
  Ldlt normal;

  MapGauge(std::span<const Eigen::Vector3d> points, std::span<const Eigen::Matrix3d> covs) {
    double sum = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      centre += points[i] / covs[i].trace();
      sum += 1.0 / covs[i].trace();
    }
    centre /= sum;
    Eigen::MatrixXd N = Eigen::MatrixXd::Zero(7, 7);
    for (std::size_t i = 0; i < points.size(); ++i) {
      G.emplace_back(similarity_moves(points[i] - centre));
      W.emplace_back(G.back() / covs[i].trace());
      N += W.back().transpose() * G.back();
    }
    normal = Ldlt(N);
  }
};

}  // namespace

/// For points in a given frame: splits their covariance into the error of the frame and that within it, at least a
/// tenth of σ. If the path defines its own frame, only the unit is given; without a unit nothing.
void PathSmoother::fill_frame(const SmootherSystem& system, const Eigen::MatrixXd& considered,
                              const PoseChain::Spread& spread, SmoothedPath& path) const {
  path.covs_in_map = path.point_covs;
  if (problem_.gauge == PathGauge::similarity || path.points.size() < 4) return;
  const MapGauge gauge(path.points, path.point_covs);
  if (!(gauge.normal.min_pivot() > 0.0)) return;
  PoseChain::Columns W{{state_.poses.size(), Eigen::MatrixXd::Zero(6, 7)},
                       {state_.points.size(), Eigen::MatrixXd::Zero(3, 7)}};
  Eigen::MatrixXd given = Eigen::MatrixXd::Zero(considered.rows(), 7), sums = Eigen::MatrixXd::Zero(7, 7);
  for (std::size_t i = 0; i < path.ids.size(); ++i) {
    const std::size_t at = index_of_.at(path.ids[i]);
    W.points[at] = gauge.W[i];
    given += spread.point_J[at].transpose() * gauge.W[i];
  }
  PoseChain::Columns Z = system.chain.solve(W, num_solved());
  for (const long id : path.ids) {
    const std::size_t at = index_of_.at(id);
    Z.points[at] += spread.point_J[at] * considered * given;
    sums += W.points[at].transpose() * Z.points[at];
  }
  const Eigen::MatrixXd of_sums = gauge.normal.solve_each(gauge.normal.solve_each(sums).transpose());
  path.frame.centre = gauge.centre;
  path.frame.cov(6, 6) = of_sums(6, 6);
  if (problem_.gauge != PathGauge::fixed) return;
  path.frame.cov = 0.5 * (of_sums + of_sums.transpose());
  constexpr double least = 0.01;  // of the variance
  for (std::size_t i = 0; i < path.ids.size(); ++i) {
    const Eigen::MatrixXd& z = Z.points[index_of_.at(path.ids[i])];
    const Eigen::MatrixXd across = gauge.G[i] * gauge.normal.solve_each(z.transpose());
    const Eigen::MatrixXd out =
        path.point_covs[i] - across - across.transpose() + gauge.G[i] * path.frame.cov * gauge.G[i].transpose();
    path.covs_in_map[i] = 0.5 * (out + out.transpose()) + least * path.point_covs[i];
  }
}

/// The same for a move of the map along a direction with more variance than its covariance has: the frame takes it.
void PathSmoother::widen_frame(std::span<const Eigen::Vector3d> moves, double more, SmoothedPath& path) const {
  if (path.points.size() < 4) return;
  const MapGauge gauge(path.points, path.covs_in_map);
  if (!(gauge.normal.min_pivot() > 0.0)) return;
  Eigen::VectorXd sums = Eigen::VectorXd::Zero(7);
  for (std::size_t i = 0; i < moves.size(); ++i) sums += gauge.W[i].transpose() * moves[i];
  const Eigen::VectorXd move = gauge.normal.solve(sums);
  path.frame = about_centre(path.frame, gauge.centre);
  path.frame.cov += more * move * move.transpose();
}

}  // namespace alidade
