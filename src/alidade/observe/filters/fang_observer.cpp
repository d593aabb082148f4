#include "alidade/observe/filters/fang_observer.h"

#include <Eigen/Cholesky>
#include <cassert>
#include <numbers>

namespace alidade {
namespace {

using Matrix8 = Eigen::Matrix<double, 8, 8>;

/// Added to a measured Ḡ, so that directions without excitation get a gain that is large, not infinite.
constexpr double gramian_floor = 1e-6;

/// Diagonal of Ḡ, median over many sets of four points in an image of 780×582
/// under the motion of the paper. The last two are for a head at a tilt of 20°.
Matrix8 typical_gramian(std::size_t num_points) {
  DifferenceParameters diagonal;
  diagonal << 2.71605e-3, 3.838248e-2, 8.0096e-3, 4.7259e-4, 1.32494e-3, 9.33727e-3, 5.6e-4, 1.1e-3;
  const double num_differences = std::max(1.0, static_cast<double>(num_points) - 1.0);
  return (num_differences / 3.0 * diagonal).asDiagonal();
}

LinearInformation<8> prior_of(const FangConfig& config) {
  const Eigen::Vector4d k = scaled_intrinsics(config.scale, config.start);
  const double f = config.prior_sigma_f_px / config.scale.scale, c = config.prior_sigma_centre_px / config.scale.scale;
  const Eigen::Matrix<double, 8, 4> j = difference_parameters_jacobian(k);
  const Matrix8 covariance = j * Eigen::Vector4d(f * f, f * f, c * c, c * c).asDiagonal() * j.transpose() +
                             config.prior_floor * Matrix8::Identity();
  return {difference_parameters(k), covariance.ldlt().solve(Matrix8::Identity())};
}

}  // namespace

FangGains gains_of(FangProfile profile) {
  if (profile == FangProfile::fast) return {.k1 = 15.0, .gain = 1500.0, .lowpass_hz = 0.0};
  return {.k1 = 2.0, .gain = 2.0, .lowpass_hz = 0.3};
}

FangObserver::FangObserver(const FangConfig& config)
    : config_(config),
      gains_(config.gains.value_or(gains_of(config.profile))),
      points_(config.num_points),
      theta_(difference_parameters(scaled_intrinsics(config.scale, config.start))),
      has_own_gain_(config.mean_gramian.has_value()) {
  set_gain(config.mean_gramian.value_or(typical_gramian(config.num_points)));
  if (config.profile == FangProfile::kalman)
    kalman_.emplace(config.num_points, prior_of(config), squared(config.sigma_px / config.scale.scale));
}

void FangObserver::set_gain(const Matrix8& mean_gramian) {
  gamma_inverse_ = mean_gramian / gains_.gain;
  gamma_ = gamma_inverse_.ldlt().solve(Matrix8::Identity());
}

const DifferenceParameters& FangObserver::theta() const { return kalman_ ? kalman_->theta().mean() : theta_; }

IntrinsicsEstimate FangObserver::step(const RotationFrame& frame) {
  nis_dof_ = 0;
  const bool has_step = frame.dt_s > 0.0;
  if (frame.px.empty() || (has_begun_ && !frame.starts_segment && !has_step)) return estimate(ObserveEvent::none);
  assert(frame.px.size() == points_.size());
  const bool is_later_segment = has_begun_ && frame.starts_segment;
  const bool had_started = has_started_;
  has_begun_ = true;
  if (frame.starts_segment) has_reference_ = false;
  if (choose_reference(frame)) take_step(frame);
  last_rate_ = frame.rate_rad_per_s;
  has_started_ = has_started_ || intrinsics_of(theta(), min_inverse_focal).has_value();
  if (is_later_segment) return estimate(ObserveEvent::new_segment);
  return estimate(has_started_ && !had_started ? ObserveEvent::start : ObserveEvent::none);
}

/// Returns false if nothing is seen. A new reference changes all differences: every point is reinitialised.
bool FangObserver::choose_reference(const RotationFrame& frame) {
  if (has_reference_ && is_seen(frame.px[reference_])) return true;
  has_reference_ = false;
  double min_distance2 = 0.0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    points_[i].is_live = false;
    if (!is_seen(frame.px[i])) continue;
    const bool is_given = config_.reference_point == i;
    const double distance2 = is_given ? 0.0 : (frame.px[i] - config_.scale.centre).squaredNorm();
    if (has_reference_ && distance2 >= min_distance2) continue;
    reference_ = i;
    min_distance2 = distance2;
    has_reference_ = true;
  }
  return has_reference_;
}

void FangObserver::take_step(const RotationFrame& frame) {
  const bool ends = config_.rates_at_ends;
  const Eigen::Vector3d& rate_0 = ends ? last_rate_ : frame.mean_rate_rad_per_s;
  const Eigen::Vector3d& rate_1 = ends ? frame.rate_rad_per_s : frame.mean_rate_rad_per_s;
  const Eigen::Vector2d reference_0 = points_[reference_].q;
  const Eigen::Vector2d reference_1 = config_.scale.normalised(frame.px[reference_]);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    Point& point = points_[i];
    const bool seen = is_seen(frame.px[i]);
    const Eigen::Vector2d q = config_.scale.normalised(frame.px[i]);
    const Eigen::Vector2d y = q - reference_1;
    point.is_moved = seen && point.is_live;
    if (point.is_moved) {
      point.omega =
          0.5 * (difference_regressor(point.q, reference_0, rate_0) + difference_regressor(q, reference_1, rate_1));
      if (!config_.roll_columns) point.omega.bottomRows<2>().setZero();
    } else if (seen) {
      point.unfiltered = point.y = point.xi = y;
      point.filtered.setZero();
    }
    point.is_live = seen && i != reference_;
    point.q = q;
  }
  add_to_gramians(frame.dt_s);
  if (kalman_) return filter_kalman(frame);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (points_[i].is_moved) low_pass(points_[i], points_[i].q - reference_1, frame.dt_s);
  }
  midpoint_step(frame.dt_s);
}

void FangObserver::add_to_gramians(double h) {
  Matrix8 sum = Matrix8::Zero();
  for (const Point& point : points_) {
    if (point.is_moved) sum.noalias() += point.omega.lazyProduct(point.omega.transpose());
  }
  gramian_.add(sum, h);
  if (has_own_gain_ || kalman_) return;
  first_gramian_ += h * sum;
  first_s_ += h;
  if (first_s_ < config_.excitation_period_s) return;
  set_gain(first_gramian_ / first_s_ + gramian_floor * Matrix8::Identity());
  has_own_gain_ = true;
}

void FangObserver::filter_kalman(const RotationFrame& frame) {
  const Eigen::Vector2d reference = points_[reference_].q;
  const double drift_variance = squared(config_.drift_px_per_sqrt_s / config_.scale.scale) * frame.dt_s;
  kalman_->begin(static_cast<Eigen::Index>(reference_));
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!points_[i].is_live) continue;
    if (points_[i].is_moved) {
      kalman_->move(static_cast<Eigen::Index>(i), frame.dt_s * points_[i].omega, drift_variance);
      nis_dof_ += 2;
    } else {
      kalman_->restart(static_cast<Eigen::Index>(i), points_[i].q - reference);
    }
  }
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (points_[i].is_live) kalman_->measure(static_cast<Eigen::Index>(i), points_[i].q - reference);
  }
  kalman_->finish();
}

/// Filters y and Ω of the step with the same low-pass (trapezoid rule), so that the regression still holds: from ẏ =
/// Ωᵀθ follows (y − y_f)/T = Ω_fᵀθ at every step. Filtering only the pixels would delay them against ω, and cause bias.
void FangObserver::low_pass(Point& point, const Eigen::Vector2d& y, double h) const {
  if (!(gains_.lowpass_hz > 0.0)) {
    point.y_mid = 0.5 * (point.unfiltered + y);
    point.y = point.unfiltered = y;
    return;
  }
  const double c = std::numbers::pi * gains_.lowpass_hz * h;  // h/2T
  const double share = 2.0 * c / (1.0 + c);
  const Eigen::Vector2d y_0 = point.y;
  const DifferenceRegressor filtered_0 = point.filtered;
  point.y += share * (0.5 * (point.unfiltered + y) - point.y);
  point.filtered += share * (point.omega - point.filtered);
  point.y_mid = 0.5 * (y_0 + point.y);
  point.omega = 0.5 * (filtered_0 + point.filtered);
  point.unfiltered = y;
}

/// (c + h²/4 ΩᵀΓΩ) e_m = y_m − ξ̂ − h/2 Ωᵀθ̂ with c = 1 + h k1/2, one equation per difference, solved as an 8×8 system
/// (Woodbury): c e_m = r − Ωᵀ(4c/h² Γ⁻¹ + ΩΩᵀ)⁻¹ Ω r.
void FangObserver::midpoint_step(double h) {
  const double c = 1.0 + 0.5 * h * gains_.k1;
  Matrix8 normal = 4.0 * c / (h * h) * gamma_inverse_;
  DifferenceParameters omega_r = DifferenceParameters::Zero();
  bool any = false;
  for (Point& point : points_) {
    if (!point.is_moved) continue;
    point.e_mid = point.y_mid - point.xi - 0.5 * h * point.omega.transpose() * theta_;
    omega_r += point.omega * point.e_mid;
    normal += point.omega.lazyProduct(point.omega.transpose());
    any = true;
  }
  if (!any) return;
  const DifferenceParameters common = normal.ldlt().solve(omega_r);
  DifferenceParameters omega_e = DifferenceParameters::Zero();
  for (Point& point : points_) {
    if (!point.is_moved) continue;
    point.e_mid = (point.e_mid - point.omega.transpose() * common) / c;
    omega_e += point.omega * point.e_mid;
  }
  const DifferenceParameters step = h * gamma_ * omega_e;
  const DifferenceParameters theta_mid = theta_ + 0.5 * step;
  theta_ += step;
  for (Point& point : points_) {
    if (point.is_moved) point.xi += h * (point.omega.transpose() * theta_mid + gains_.k1 * point.e_mid);
  }
}

IntrinsicsEstimate FangObserver::estimate(ObserveEvent event) const {
  IntrinsicsEstimate estimate;
  estimate.event = event;
  estimate.sigma.setConstant(std::numeric_limits<double>::quiet_NaN());
  const std::optional<Eigen::Vector4d> k = intrinsics_of(theta(), min_inverse_focal);
  if (!has_started_ || !k) return estimate;
  const Eigen::Vector4d px = intrinsics_in_px(config_.scale, *k);
  estimate.has_value = true;
  estimate.fx = px[0];
  estimate.fy = px[1];
  estimate.cx = px[2];
  estimate.cy = px[3];
  if (!kalman_) return estimate;
  estimate.sigma = config_.scale.scale * kalman_->theta().variances<4>(intrinsics_jacobian(theta())).cwiseSqrt();
  estimate.nis_dof = nis_dof_;
  if (nis_dof_ > 0) estimate.nis = kalman_->theta().nis();
  return estimate;
}

}  // namespace alidade
