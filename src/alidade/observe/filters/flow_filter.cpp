#include "alidade/observe/filters/flow_filter.h"

#include <algorithm>
#include <cassert>

namespace alidade {
namespace {

constexpr int max_projection_steps = 3;
/// χ² with ten degrees of freedom: by chance less than once in a million.
constexpr double implausible_chi2 = 50.0;

}  // namespace

FlowFilter::FlowFilter(const FlowFilterConfig& config)
    : config_(config),
      num_columns_(config.roll_columns ? 14 : 10),
      variance_(squared(config.sigma_px / config.scale.scale)),
      theta_(flow_parameters(scaled_intrinsics(config.scale, config.start)),
             Eigen::Matrix<double, 14, 14>::Identity() / squared(config.prior_sigma)),
      points_(config.num_points),
      k_(scaled_intrinsics(config.scale, config.start)) {}

IntrinsicsEstimate FlowFilter::step(const RotationFrame& frame) {
  const bool has_step = frame.dt_s > 0.0 && !frame.starts_segment;
  if (frame.px.empty() || (has_begun_ && !frame.starts_segment && !has_step)) {
    theta_.begin();
    return estimate(ObserveEvent::none);
  }
  assert(frame.px.size() == points_.size());
  const bool had_value = has_value_;
  theta_.begin();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    Point& point = points_[i];
    const bool seen = is_seen(frame.px[i]);
    const Eigen::Vector2d q = config_.scale.normalised(frame.px[i]);
    if (seen && point.is_live && has_step)
      advance(point, q, frame);
    else if (seen)
      restart(point, q);
    point.is_live = seen;
  }
  if (theta_.num_scalars() > 0) {
    theta_.finish();
    project();
  }
  last_rate_ = frame.rate_rad_per_s;
  const bool is_later_segment = has_begun_ && frame.starts_segment;
  has_begun_ = true;
  if (is_later_segment) return estimate(ObserveEvent::new_segment);
  return estimate(has_value_ && !had_value ? ObserveEvent::start : ObserveEvent::none);
}

/// Prediction and update of both coordinates. Given Θ, the uncertainty of a coordinate is a single variance s.
void FlowFilter::advance(Point& point, const Eigen::Vector2d& q, const RotationFrame& frame) {
  const bool ends = config_.rates_at_ends;
  FlowRegressor mean = 0.5 * (flow_regressor(point.q, ends ? last_rate_ : frame.mean_rate_rad_per_s) +
                              flow_regressor(q, ends ? frame.rate_rad_per_s : frame.mean_rate_rad_per_s));
  if (num_columns_ == 10) mean.bottomRows<4>().setZero();
  point.b += frame.dt_s * mean;
  point.s += squared(config_.drift_px_per_sqrt_s / config_.scale.scale) * frame.dt_s;
  const double innovation_variance = point.s + variance_;
  const double gain = point.s / innovation_variance;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    theta_.add(point.b.col(axis), q[axis] - point.a[axis], innovation_variance);
    point.a[axis] += gain * (q[axis] - point.a[axis]);
  }
  point.b *= 1.0 - gain;
  point.s *= 1.0 - gain;
  point.q = q;
}

void FlowFilter::restart(Point& point, const Eigen::Vector2d& q) const {
  point.q = point.a = q;
  point.b.setZero();
  point.s = variance_;
}

/// Starts at the last estimate; if the result does not fit (perhaps a local minimum), Θ̂ itself is tried as well.
void FlowFilter::project() {
  const Eigen::Matrix<double, 14, 14> information = theta_.information();
  Projection best = projection_from(k_, information);
  if (!(best.chi2 < implausible_chi2)) {
    const auto plain = intrinsics_of(theta_.mean()(difference_rows), min_inverse_focal);
    const Projection other = plain ? projection_from(*plain, information) : best;
    if (other.chi2 < best.chi2) best = other;
  }
  k_ = best.k;
  sigma_k_ = best.sigma;
  has_value_ = k_.allFinite() && sigma_k_.allFinite();
}

/// Gauss–Newton. A focal length changes by at most a factor of 2 per step, as the first frames determine little.
FlowFilter::Projection FlowFilter::projection_from(const Eigen::Vector4d& start,
                                                   const Eigen::Matrix<double, 14, 14>& information) const {
  Projection at{.k = start};
  Eigen::Matrix<double, 14, 14> weight = information;
  if (num_columns_ == 10) weight.bottomRows<4>().setZero();  // the ten are independent of the four unused columns
  Eigen::Matrix4d normal;
  for (int i = 0; i < max_projection_steps; ++i) {
    const Eigen::Matrix<double, 14, 4> j = flow_parameters_jacobian(at.k);
    const Eigen::Matrix<double, 14, 4> weighted = weight * j;
    normal = weighted.transpose() * j;
    const Eigen::Vector4d step = normal.ldlt().solve(weighted.transpose() * (theta_.mean() - flow_parameters(at.k)));
    if (!step.allFinite()) break;
    for (Eigen::Index axis = 0; axis < 2; ++axis)
      at.k[axis] = std::clamp(at.k[axis] + step[axis], 0.5 * at.k[axis], 2.0 * at.k[axis]);
    at.k.tail<2>() += step.tail<2>();
  }
  const FlowParameters error = theta_.mean() - flow_parameters(at.k);
  at.chi2 = error.dot(weight * error);
  at.sigma = normal.inverse().diagonal().cwiseSqrt();
  return at;
}

IntrinsicsEstimate FlowFilter::estimate(ObserveEvent event) const {
  IntrinsicsEstimate estimate;
  estimate.event = event;
  estimate.has_value = has_value_;
  if (!has_value_) return estimate;
  const Eigen::Vector4d px = intrinsics_in_px(config_.scale, k_);
  estimate.fx = px[0];
  estimate.fy = px[1];
  estimate.cx = px[2];
  estimate.cy = px[3];
  estimate.sigma = config_.scale.scale * sigma_k_;
  if (theta_.num_scalars() > 0) {
    estimate.nis = theta_.nis();
    estimate.nis_dof = theta_.num_scalars();
  }
  return estimate;
}

}  // namespace alidade
