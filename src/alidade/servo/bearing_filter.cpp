#include "alidade/servo/bearing_filter.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace alidade {
namespace {

/// F of Singer's model: the acceleration decays with time constant τ.
Eigen::Matrix3d singer_transition(double tau_s, double dt_s) {
  const double a = dt_s / tau_s, decay = std::exp(-a);
  Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
  F(0, 1) = dt_s;
  F(0, 2) = tau_s * tau_s * (a - 1.0 + decay);
  F(1, 2) = tau_s * (1.0 - decay);
  F(2, 2) = decay;
  return F;
}

/// Q of Singer's model for σ = 1, closed form; R. A. Singer, 1970, appendix.
Eigen::Matrix3d singer_noise(double tau_s, double dt_s) {
  const double a = dt_s / tau_s, tau2 = tau_s * tau_s, e = std::exp(-a), e2 = std::exp(-2.0 * a);
  Eigen::Matrix3d Q;
  if (a < 1e-2) {  // the closed form suffers from cancellation: leading terms of its series
    const double q = 2.0 / tau_s;
    Q << q * std::pow(dt_s, 5) / 20.0, q * std::pow(dt_s, 4) / 8.0, q * std::pow(dt_s, 3) / 6.0, 0.0,
        q * std::pow(dt_s, 3) / 3.0, q * dt_s * dt_s / 2.0, 0.0, 0.0, q * dt_s;
  } else {
    Q << tau2 * tau2 * (1.0 - e2 + 2.0 * a + 2.0 * a * a * a / 3.0 - 2.0 * a * a - 4.0 * a * e),
        tau2 * tau_s * (e2 + 1.0 - 2.0 * e + 2.0 * a * e - 2.0 * a + a * a), tau2 * (1.0 - e2 - 2.0 * a * e), 0.0,
        tau2 * (4.0 * e - 3.0 - e2 + 2.0 * a), tau_s * (e2 + 1.0 - 2.0 * e), 0.0, 0.0, 1.0 - e2;
  }
  mirror_upper<3>(Q);
  return Q;
}

/// The matrices of one time step that all models share.
struct SingerStep {
  Eigen::Matrix3d F = Eigen::Matrix3d::Identity(), Q = Eigen::Matrix3d::Zero();

  SingerStep(double tau_s, double dt_s) {
    if (!(dt_s > 0.0)) return;
    F = singer_transition(tau_s, dt_s);
    Q = singer_noise(tau_s, dt_s);
  }
  [[nodiscard]] Belief<3> predicted(const Belief<3>& now, double sigma_rad_s2) const {
    Belief<3> later;
    later.x = F * now.x;
    later.P = F * now.P * F.transpose() + sigma_rad_s2 * sigma_rad_s2 * Q;
    mirror_upper<3>(later.P);
    return later;
  }
};

}  // namespace

Bearing ahead(const Bearing& bearing, double singer_tau_s, double dt_s) {
  const Eigen::Vector3d x = singer_transition(singer_tau_s, dt_s) *
                            Eigen::Vector3d(bearing.angle_rad, bearing.rate_rad_s, bearing.acceleration_rad_s2);
  return {x[0], x[1], x[2], bearing.sigma_rad};
}

void BearingAxis::start(double t_s, double angle_rad, double variance_rad2, const LensEffect& effect) {
  t_s_ = t_s;
  for (std::size_t i = 0; i < num_agilities; ++i) {
    const double sigma = config_.sigma_rad_s2[i];
    // The rate that a model's acceleration reaches within its time constant; the most manoeuvring model may have any.
    const double rate = i + 1 == num_agilities ? config_.start_rate_rad_s
                                               : std::min(config_.start_rate_rad_s, sigma * config_.singer_tau_s);
    beliefs_[i].x = {angle_rad, 0.0, 0.0};  // after a jump, no rate or acceleration is assumed
    beliefs_[i].P = Eigen::Vector3d(variance_rad2 + effect.squaredNorm(), rate * rate, sigma * sigma).asDiagonal();
    with_lens_[i].setZero();
    with_lens_[i].row(0) = -effect;  // error of the state minus belief: the excess of the observation
  }
  log_weights_.fill(0.0);
  weights_.fill(1.0 / num_agilities);
}

double BearingAxis::surprise(double t_s, double angle_rad, double variance_rad2, double usual_gap_s) const {
  const double nu = angle_rad - at(t_s).angle_rad, sigma = at(t_s_ + usual_gap_s).sigma_rad;
  return nu * nu / (sigma * sigma + variance_rad2);
}

void BearingAxis::update(double t_s, double angle_rad, double variance_rad2, const LensEffect& effect) {
  const SingerStep step(config_.singer_tau_s, t_s - t_s_);
  const double fade = std::exp(-(t_s - t_s_) / config_.memory_s);
  for (std::size_t i = 0; i < num_agilities; ++i) {
    Belief<3> belief = step.predicted(beliefs_[i], config_.sigma_rad_s2[i]);
    const Eigen::Matrix<double, 3, 2> with_lens = step.F * with_lens_[i];
    // z = angle + effect u + n: the lens errors u are not estimated, but their covariance with the state is kept.
    const Eigen::Vector3d PHt = belief.P.col(0) + with_lens * effect.transpose();
    const Eigen::RowVector2d CHt = with_lens.row(0) + effect;
    const double nu = angle_rad - belief.x[0], S = PHt[0] + effect.dot(CHt) + variance_rad2;
    const Eigen::Vector3d K = PHt / S;
    with_lens_[i] = with_lens - K * CHt;
    belief.x += K * nu;
    belief.P -= K * K.transpose() * S;
    mirror_upper<3>(belief.P);
    beliefs_[i] = belief;
    log_weights_[i] = fade * log_weights_[i] - 0.5 * (nu * nu / S + std::log(S));
  }
  const double highest = *std::ranges::max_element(log_weights_);
  double sum = 0.0;
  for (std::size_t i = 0; i < num_agilities; ++i) sum += weights_[i] = std::exp(log_weights_[i] - highest);
  for (double& weight : weights_) weight /= sum;
  t_s_ = t_s;
}

Bearing BearingAxis::at(double t_s) const {
  const SingerStep step(config_.singer_tau_s, t_s - t_s_);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double second_moment = 0.0;
  for (std::size_t i = 0; i < num_agilities; ++i) {
    const Belief<3> belief = step.predicted(beliefs_[i], config_.sigma_rad_s2[i]);
    mean += weights_[i] * belief.x;
    second_moment += weights_[i] * (belief.P(0, 0) + belief.x[0] * belief.x[0]);
  }
  return {mean[0], mean[1], mean[2], std::sqrt(std::max(0.0, second_moment - mean[0] * mean[0]))};
}

ObservationUse BearingFilter::begin(double t_s, const Eigen::Vector2d& bearing_rad, double variance,
                                    const std::array<LensEffect, 2>& effects, ObservationUse as) {
  for (std::size_t axis = 0; axis < 2; ++axis)
    axes_[axis].start(t_s, bearing_rad[static_cast<Eigen::Index>(axis)], variance, effects[axis]);
  newest_s_ = t_s;
  has_started_ = true;
  num_gated_ = 0;
  return as;
}

ObservationUse BearingFilter::take(double t_capture_s, const Eigen::Vector2d& bearing_rad, double sigma_rad,
                                   const std::array<LensEffect, 2>& effects) {
  const double variance = sigma_rad * sigma_rad;
  if (!has_started_) return begin(t_capture_s, bearing_rad, variance, effects, ObservationUse::started);
  if (!(t_capture_s > newest_s_)) return ObservationUse::late;
  const double gap_s = num_gated_ == 0 ? t_capture_s - newest_s_ : usual_gap_s_;
  bool is_expected = true;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double angle = bearing_rad[static_cast<Eigen::Index>(axis)];
    const double with_lens = variance + effects[axis].squaredNorm();
    if (!(axes_[axis].surprise(t_capture_s, angle, with_lens, gap_s) <= config_.gate)) is_expected = false;
  }
  if (!is_expected) {
    usual_gap_s_ = gap_s;
    if (++num_gated_ >= config_.restart_after)
      return begin(t_capture_s, bearing_rad, variance, effects, ObservationUse::restarted);
    return ObservationUse::gated;
  }
  for (std::size_t axis = 0; axis < 2; ++axis)
    axes_[axis].update(t_capture_s, bearing_rad[static_cast<Eigen::Index>(axis)], variance, effects[axis]);
  newest_s_ = t_capture_s;
  num_gated_ = 0;
  return ObservationUse::used;
}

}  // namespace alidade
