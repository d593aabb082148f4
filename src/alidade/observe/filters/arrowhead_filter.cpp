#include "alidade/observe/filters/arrowhead_filter.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

constexpr double new_inverse_depth = 0.2;        // a point of unknown depth: 5 m,
constexpr double new_inverse_depth_sigma = 0.5;  // 1.4 m to infinity at one σ

CommonMatrix inverse(const CommonMatrix& symmetric) {
  return symmetric.llt().solve(CommonMatrix::Identity(symmetric.rows(), symmetric.cols()));
}

}  // namespace

ArrowheadFilter::ArrowheadFilter(const ObserveNuisances& nuisances, bool with_depth, std::size_t num_points)
    : nuisances_(nuisances),
      layout_(nuisances),
      with_depth_(with_depth),
      points_(num_points),
      seen_(num_points),
      was_rejected_(num_points) {
  const int n = layout_.size;
  covariance_.setIdentity(n, n);
  precision_.setIdentity(n, n);
  information_.setZero(n, n);
  gradient_.setZero(n);
  for (Point& point : points_) point.slope.setZero(3, n);
  for (Seen& seen : seen_) seen.by_common.setZero(2, n);
}

void ArrowheadFilter::start(const BundleSolution& solution, const std::vector<int>& bundle_point_of, double sigma_px) {
  nuisances_.learnt = false;
  layout_ = CommonLayout(nuisances_);
  const int n = layout_.size, solved = static_cast<int>(solution.information.rows());
  variance_px_ = sigma_px * sigma_px;
  camera_ = solution.camera;
  covariance_.setZero(n, n);
  covariance_.topLeftCorner(solved, solved) = solution.covariance();
  precision_ = inverse(covariance_);
  // A zoom may have extended the layout by four entries before.
  information_.setZero(n, n);
  gradient_.setZero(n);
  num_seen_ = 0;
  is_summed_ = false;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const int from = bundle_point_of[i];
    Point& point = points_[i];
    point.slope.setZero(3, n);
    point.known = from >= 0 && static_cast<std::size_t>(from) < solution.given_common.size();
    if (!point.known) continue;
    point.bearing = solution.points[static_cast<std::size_t>(from)];
    point.slope.leftCols(solved) = solution.given_common[static_cast<std::size_t>(from)].slope;
    point.cov = solution.given_common[static_cast<std::size_t>(from)].cov;
  }
}

void ArrowheadFilter::forget_points() {
  for (Point& point : points_) point.known = false;
}

void ArrowheadFilter::remember_intrinsics() {
  if (nuisances_.learnt) return;
  const int n = layout_.size;
  nuisances_.learnt = true;
  layout_ = CommonLayout(nuisances_);  // the four new entries come last: a filter estimates no rotation
  const CommonMatrix before = covariance_;
  covariance_.resize(n + 4, n + 4);
  covariance_.topLeftCorner(n, n) = before;
  covariance_.bottomLeftCorner(4, n) = before.topRows<4>();
  covariance_.topRightCorner(n, 4) = before.leftCols<4>();
  covariance_.bottomRightCorner<4, 4>() = before.topLeftCorner<4, 4>();
  // The copy is identical to the original at first; the process noise that follows separates them.
  covariance_.diagonal().head<4>().array() += 1e-12;
  precision_ = inverse(covariance_);
  for (Point& point : points_) {
    const PointByCommonSlope slope = point.slope;
    point.slope.setZero(3, n + 4);
    point.slope.leftCols(n) = slope;
    point.slope.leftCols<4>().setZero();
    point.slope.rightCols<4>() = slope.leftCols<4>();
  }
  information_.setZero(n + 4, n + 4);
  gradient_.setZero(n + 4);
  is_summed_ = false;
}

void ArrowheadFilter::predict(const CommonVector& variance, double rotation_sigma_rad) {
  const bool turns = layout_.rotation >= 0 && rotation_sigma_rad > 0.0;
  if (!turns && variance.isZero(0.0)) return;
  // c' = F c + w:  P' = F P Fᵀ + Q,  G = P Fᵀ P'⁻¹. The slope A of a point becomes A G, its covariance is increased by
  // A (P − G P' Gᵀ) Aᵀ.
  const CommonMatrix before = covariance_;
  CommonMatrix kept = before;  // P Fᵀ
  if (turns) {
    kept.middleCols<3>(layout_.rotation).setZero();
    covariance_.middleCols<3>(layout_.rotation).setZero();
    covariance_.middleRows<3>(layout_.rotation).setZero();
    covariance_.diagonal().segment<3>(layout_.rotation).setConstant(rotation_sigma_rad * rotation_sigma_rad);
    camera_.rotation_error_rad.setZero();
  }
  covariance_.diagonal() += variance;
  precision_ = inverse(covariance_);
  const CommonMatrix gain = kept * precision_;
  const CommonMatrix lost = before - gain * covariance_ * gain.transpose();
  for (Point& point : points_) {
    if (!point.known) continue;
    point.cov.noalias() += point.slope * lost * point.slope.transpose();
    point.slope = (point.slope * gain).eval();
  }
}

void ArrowheadFilter::observe(const RotationFrame& frame, std::span<const Eigen::Vector2d> px) {
  frame_ = frame;
  px_ = px;
  num_seen_ = 0;
  is_summed_ = false;
  const RotationView view(camera_, frame);
  RotationPrediction prediction;
  for (std::size_t i = 0; i < points_.size() && i < px.size(); ++i) {
    const Point& point = points_[i];
    if (!point.known || !is_seen(px[i]) || !view.predict(point.bearing, layout_, prediction)) continue;
    Seen& seen = seen_[num_seen_++];
    seen.point = static_cast<int>(i);
    seen.rejected = false;
    seen.innovation = px[i] - prediction.px;
    seen.J_point = prediction.J_px_point;
    seen.by_common = prediction.J_px_common;
    Eigen::Matrix2d cov = Eigen::Matrix2d::Identity() * (variance_px_ * point.variance_factor);
    if (with_depth_) {
      seen.through_point.noalias() = seen.J_point * point.slope;
      cov.noalias() += seen.J_point * point.cov * seen.J_point.transpose();
    } else {
      const Eigen::Matrix2d J = seen.J_point.leftCols<2>();
      seen.through_point.noalias() = J * point.slope.topRows<2>();
      cov.noalias() += J * point.cov.topLeftCorner<2, 2>() * J.transpose();
    }
    seen.by_common += seen.through_point;
    seen.inverse_cov = cov.inverse();
  }
}

void ArrowheadFilter::observe_again(const RotationFrame& frame, std::span<const Eigen::Vector2d> px) {
  std::fill(was_rejected_.begin(), was_rejected_.end(), false);
  for (std::size_t i = 0; i < num_seen_; ++i)
    was_rejected_[static_cast<std::size_t>(seen_[i].point)] = seen_[i].rejected;
  observe(frame, px);
  for (std::size_t i = 0; i < num_seen_; ++i)
    seen_[i].rejected = was_rejected_[static_cast<std::size_t>(seen_[i].point)];
}

int ArrowheadFilter::dof() const {
  int count = 0;
  for (std::size_t i = 0; i < num_seen_; ++i) count += seen_[i].rejected ? 0 : 2;
  return count;
}

void ArrowheadFilter::accumulate() {
  if (is_summed_) return;
  is_summed_ = true;
  information_.setZero();
  gradient_.setZero();
  squares_ = 0.0;
  for (std::size_t i = 0; i < num_seen_; ++i) {
    const Seen& seen = seen_[i];
    if (seen.rejected) continue;
    const PixelByCommon weighted = seen.inverse_cov * seen.by_common;
    information_.noalias() += seen.by_common.transpose() * weighted;
    gradient_.noalias() += weighted.transpose() * seen.innovation;
    squares_ += seen.innovation.dot(seen.inverse_cov * seen.innovation);
  }
}

double ArrowheadFilter::nis() {
  accumulate();
  const CommonMatrix all = precision_ + information_;
  return squares_ - gradient_.dot(all.llt().solve(gradient_));
}

ArrowheadFilter::Hypothesis ArrowheadFilter::with_added_variance(const CommonVector& variance) const {
  CommonMatrix walked = covariance_;
  walked.diagonal() += variance;
  CommonMatrix information = inverse(walked);
  // As in predict(): the points stay fixed while the camera changes.
  const CommonMatrix gain = covariance_ * information;
  const CommonMatrix lost = covariance_ - gain * walked * gain.transpose();
  const CommonMatrix change = gain - CommonMatrix::Identity(layout_.size, layout_.size);
  CommonVector gradient = CommonVector::Zero(layout_.size);
  double squares = 0.0;
  for (std::size_t i = 0; i < num_seen_; ++i) {
    const Seen& seen = seen_[i];
    if (seen.rejected) continue;
    const PixelByCommon by_common = seen.by_common + seen.through_point * change;
    const Eigen::Matrix2d cov = seen.inverse_cov.inverse() + seen.through_point * lost * seen.through_point.transpose();
    const Eigen::Matrix2d inverse_cov = cov.inverse();
    information.noalias() += by_common.transpose() * inverse_cov * by_common;
    gradient.noalias() += by_common.transpose() * (inverse_cov * seen.innovation);
    squares += seen.innovation.dot(inverse_cov * seen.innovation);
  }
  const CommonVector step = information.llt().solve(gradient);
  return {squares - gradient.dot(step), step, change};
}

double ArrowheadFilter::left_over(std::size_t i, const Hypothesis& hypothesis) const {
  const Seen& seen = seen_[i];
  const PixelByCommon by_common = seen.by_common + seen.through_point * hypothesis.point_change;
  const Eigen::Vector2d rest = seen.innovation - by_common * hypothesis.step;
  return rest.dot(seen.inverse_cov * rest);
}

void ArrowheadFilter::add_score(Eigen::Vector4d& score, Eigen::Matrix4d& information) {
  accumulate();
  // By Woodbury's identity Gᵀ S⁻¹ = (1 + Λ P)⁻¹ Gᵀ R⁻¹, Λ = Gᵀ R⁻¹ G.
  const CommonMatrix both = CommonMatrix::Identity(layout_.size, layout_.size) + information_ * covariance_;
  const Eigen::PartialPivLU<CommonMatrix> solver(both);
  score += solver.solve(gradient_).head<4>();
  information += solver.solve(information_).topLeftCorner<4, 4>();
}

void ArrowheadFilter::add_point_score(std::size_t i, Eigen::Vector4d& score, Eigen::Matrix4d& information) const {
  const Eigen::Matrix<double, 2, 4> by_k = seen_[i].by_common.leftCols<4>();
  score.noalias() += by_k.transpose() * (seen_[i].inverse_cov * seen_[i].innovation);
  information.noalias() += by_k.transpose() * seen_[i].inverse_cov * by_k;
}

double ArrowheadFilter::point_nis(std::size_t i) const {
  const Seen& seen = seen_[i];
  const Eigen::Matrix2d cov = seen.inverse_cov.inverse() + seen.by_common * covariance_ * seen.by_common.transpose();
  return seen.innovation.dot(cov.inverse() * seen.innovation);
}

void ArrowheadFilter::move_common(const CommonVector& step) {
  camera_ = camera_.retract(layout_, step);
  for (Point& point : points_) {
    if (!point.known) continue;
    const Eigen::Vector3d move = point.slope * step;
    point.bearing.ab += move.head<2>();
    if (with_depth_) point.bearing.inverse_depth += move.z();
  }
}

void ArrowheadFilter::update() {
  accumulate();
  precision_ += information_;
  covariance_ = inverse(precision_);
  const CommonVector step = covariance_ * gradient_;
  move_common(step);
  for (std::size_t i = 0; i < num_seen_; ++i) {
    const Seen& seen = seen_[i];
    if (seen.rejected) continue;
    Point& point = points_[static_cast<std::size_t>(seen.point)];
    const Eigen::Vector2d rest = seen.innovation - seen.by_common * step;
    if (with_depth_) {
      const Eigen::Matrix<double, 3, 2> gain = point.cov * seen.J_point.transpose() * seen.inverse_cov;
      point.slope.noalias() -= gain * seen.by_common;
      const Eigen::Vector3d move = gain * rest;
      point.bearing.ab += move.head<2>();
      point.bearing.inverse_depth += move.z();
      point.cov = (point.cov - gain * seen.J_point * point.cov).eval();
    } else {
      const Eigen::Matrix2d cov = point.cov.topLeftCorner<2, 2>();
      const Eigen::Matrix2d gain = cov * seen.J_point.leftCols<2>().transpose() * seen.inverse_cov;
      point.slope.topRows<2>().noalias() -= gain * seen.by_common;
      point.bearing.ab += gain * rest;
      point.cov.topLeftCorner<2, 2>() = cov - gain * seen.J_point.leftCols<2>() * cov;
    }
  }
  add_new_points(frame_, px_);
}

/// A point seen for the first time: for every c its pixel gives a and b by p(c, b) = px; slope: −(∂p/∂b)⁻¹ ∂p/∂c.
void ArrowheadFilter::add_new_points(const RotationFrame& frame, std::span<const Eigen::Vector2d> px) {
  const RotationView view(camera_, frame);
  RotationPrediction prediction;
  for (std::size_t i = 0; i < points_.size() && i < px.size(); ++i) {
    Point& point = points_[i];
    if (point.known || !is_seen(px[i])) continue;
    const auto ray = view.ray_in_start(px[i]);
    if (!ray) continue;
    point.bearing = {rotation_to(*ray), Eigen::Vector2d::Zero(), with_depth_ ? new_inverse_depth : 0.0};
    if (!view.predict(point.bearing, layout_, prediction)) continue;
    const Eigen::Matrix2d J = prediction.J_px_point.leftCols<2>();
    if (!(std::abs(J.determinant()) > 1e-12)) continue;
    const Eigen::Matrix2d J_inverse = J.inverse();
    const Eigen::Vector2d by_depth = J_inverse * prediction.J_px_point.col(2);
    point.known = true;
    point.bearing.ab = J_inverse * (px[i] - prediction.px);
    point.slope.setZero();
    point.slope.topRows<2>() = -J_inverse * prediction.J_px_common;
    point.cov.setZero();
    point.cov.topLeftCorner<2, 2>() = variance_px_ * point.variance_factor * J_inverse * J_inverse.transpose();
    if (with_depth_) {
      constexpr double variance = new_inverse_depth_sigma * new_inverse_depth_sigma;
      point.cov.topLeftCorner<2, 2>() += variance * by_depth * by_depth.transpose();
      point.cov.topRightCorner<2, 1>() = -variance * by_depth;
      point.cov.bottomLeftCorner<1, 2>() = -variance * by_depth.transpose();
      point.cov(2, 2) = variance;
    }
  }
}

bool ArrowheadFilter::update_range(const RotationFrame& frame, std::size_t i, double range_m, double sigma_range_m) {
  Point& point = points_[i];
  if (!with_depth_ || !point.known || !(point.bearing.inverse_depth > 1e-6)) return false;
  const RotationView view(camera_, frame);
  const double chi = point.bearing.inverse_depth;
  const Eigen::Vector3d d = view.point_in_cam(point.bearing);
  PointByCommonSlope J_common;
  Eigen::Matrix3d J_point;
  view.point_jacobians(point.bearing, layout_, J_common, J_point);
  // ln range is nearly linear in the logarithm of the depth, even while the depth is still far off.
  const Eigen::RowVector3d J_d = d.transpose() / d.squaredNorm();
  Eigen::RowVector3d by_point = J_d * J_point;
  by_point[2] -= 1.0 / chi;
  const CommonVector by_common = (J_d * J_common + by_point * point.slope).transpose();
  const double innovation = std::log(range_m) - std::log(d.norm() / chi);
  const double given = by_point.dot(point.cov * by_point.transpose()) + std::pow(sigma_range_m / range_m, 2);
  const double variance = given + by_common.dot(covariance_ * by_common);
  if (!(innovation * innovation < 16.0 * variance)) return false;
  const CommonVector gain_common = covariance_ * by_common / variance;
  const CommonVector step = gain_common * innovation;
  covariance_ = (covariance_ - variance * gain_common * gain_common.transpose()).eval();
  precision_ = inverse(covariance_);
  move_common(step);
  const Eigen::Vector3d gain = point.cov * by_point.transpose() / given;
  const Eigen::Vector3d move = gain * (innovation - by_common.dot(step));
  point.bearing.ab += move.head<2>();
  point.bearing.inverse_depth += move.z();
  point.slope -= (gain * by_common.transpose()).eval();
  point.cov = (point.cov - gain * by_point * point.cov).eval();
  return true;
}

}  // namespace alidade
