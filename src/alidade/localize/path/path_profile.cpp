#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/path/path_system.h"

// A flat target seen from one side hardly determines its tilt, and does so the less linearly the larger σ is: the
// posterior is a curved valley, and the covariance at its minimum describes one tangent only. So the least certain
// combination of a pose's components is fixed at ±3σ, all else is estimated again, and the increase of the cost is
// compared with the expected value of 9 (a profile likelihood: D. M. Bates & D. G. Watts, "Nonlinear Regression
// Analysis", 1988, §6.1).

namespace alidade {
namespace {

Eigen::Vector<double, 6> right_perturbation(const Rigid3& from, const Rigid3& to) {
  Eigen::Vector<double, 6> xi;
  xi << from.rotation.conjugate() * (to.translation - from.translation),
      log_so3(from.rotation.conjugate() * to.rotation);
  return xi;
}

}  // namespace

void PathSmoother::add_fixed(const SmootherState& state, SmootherSystem& system) const {
  const Rigid3& now = state.poses[fixed_->frame];
  const Eigen::Vector<double, 6> xi = right_perturbation(fixed_->from, now);
  Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Zero();
  J.topLeftCorner<3, 3>() = fixed_->from.rotation.toRotationMatrix().transpose();
  J.bottomRightCorner<3, 3>() = right_jacobian(xi.tail<3>()).inverse();
  const Eigen::Vector<double, 6> by = J.transpose() * fixed_->weights / fixed_->sigma;
  const double error = (fixed_->weights.dot(xi) - fixed_->value) / fixed_->sigma;
  system.chain.A.topLeftCorner<6, 6>() += by * by.transpose();
  system.chain.a.head<6>() -= by * error;
  system.cost += error * error;
}

/// Selects the pose with the least certain position and, of its components (lengths over the distance), the least
/// certain combination. False if σ is small enough for the linear approximation.
bool PathSmoother::fix_weakest(const SmoothedPath& path) {
  constexpr double straight = 0.012;  // relative to the distance, and rad
  FixedCombination fixed;
  double max_m2 = 0.0;
  for (std::size_t k = 0; k < path.cov.size(); ++k) {
    const double variance_m2 = path.cov[k].topLeftCorner<3, 3>().trace();
    if (!(variance_m2 > max_m2)) continue;
    max_m2 = variance_m2;
    fixed.frame = k;
  }
  fixed.from = path.world_from_cam[fixed.frame];
  const double distance_m = (fixed.from.translation - target_centre_).norm();
  Eigen::Vector<double, 6> scale = Eigen::Vector<double, 6>::Ones();
  scale.head<3>() /= distance_m;
  const SymmetricEigen eigen = symmetric_eigen(scaled_by(scale, path.cov[fixed.frame]));
  const double sigma = std::sqrt(eigen.values[5]);
  fixed.weights = scale.asDiagonal() * eigen.vectors.col(5);
  fixed.sigma = 0.02 * sigma;
  fixed.value = sigma;
  if (!(sigma > straight)) return false;
  fixed_ = fixed;
  return true;
}

namespace {

/// Whether the positions of a path vary little relative to the distance, and little more than their uncertainty.
bool is_from_one_place(const SmoothedPath& path, const Eigen::Vector3d& target) {
  constexpr double apart = 12.0, parallax = 0.05;
  const double num = static_cast<double>(path.cov.size());
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Rigid3& pose : path.world_from_cam) centre += pose.translation / num;
  double spread_m2 = 0.0, variance_m2 = 0.0;
  for (std::size_t k = 0; k < path.cov.size(); ++k) {
    spread_m2 += (path.world_from_cam[k].translation - centre).squaredNorm() / num;
    variance_m2 += path.cov[k].topLeftCorner<3, 3>().trace() / num;
  }
  const double aside_m = parallax * (centre - target).norm();
  return spread_m2 < std::min(apart * apart * variance_m2, aside_m * aside_m);
}

}  // namespace

void PathSmoother::widen(double min_cost, SmoothedPath& path) {
  if (!fix_weakest(path)) return;
  path.is_from_one_place = is_from_one_place(path, target_centre_);
  constexpr double sides = 3.0, most = 4.0, little = 0.5;
  const SmootherState best = state_;
  const double sigma = fixed_->value;
  std::optional<SmootherState> widest;
  double reached_there = 1.0;
  for (const double side : {sides, -sides}) {
    state_ = best;
    fixed_->value = side * sigma;
    if (!settle()) continue;
    const double reached = fixed_->weights.dot(right_perturbation(fixed_->from, state_.poses[fixed_->frame])) / sigma;
    const FixedCombination fixed = *fixed_;
    fixed_.reset();
    const auto there = build(state_, Shared::solved);
    fixed_ = fixed;
    if (!there) continue;
    const double rise = std::max(there->cost - min_cost, little);
    const double factor = std::min(std::abs(reached) / std::sqrt(rise), most);
    if (!(factor > path.widened)) continue;
    path.widened = factor;
    widest = state_;
    reached_there = reached;
  }
  fixed_.reset();
  state_ = best;
  if (!widest) return;
  const double more = (path.widened * path.widened - 1.0) / (reached_there * reached_there);
  for (std::size_t k = 0; k < path.cov.size(); ++k) {
    const Eigen::Vector<double, 6> move = right_perturbation(best.poses[k], widest->poses[k]);
    path.cov[k] += more * move * move.transpose();
  }
  std::vector<Eigen::Vector3d> moves;
  for (std::size_t i = 0; i < path.point_covs.size(); ++i) {
    const std::size_t at = index_of_.at(path.ids[i]);
    moves.emplace_back(widest->points[at] - best.points[at]);
    path.point_covs[i] += more * moves.back() * moves.back().transpose();
  }
  widen_frame(moves, more, path);
}

}  // namespace alidade
