#include "alidade/servo/axis/axis_observer.h"

#include <cmath>

namespace alidade {
namespace {

/// Stationary Kalman gain of the state (angle, rate, disturbance) for an encoder with this σ.
Eigen::Vector3d kalman_gain(const AxisModel& model, double gain, double sigma_encoder_rad) {
  Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
  F.topLeftCorner<2, 2>() = model.A;
  F.topRightCorner<2, 1>() = model.B;
  // With a fifth of the command's gain unknown, the disturbance for a hand-held target drifts by some mrad per sample.
  const double drift = (model.is_rate_plant ? 0.02 : 0.002) / gain;
  const double R = std::max(sigma_encoder_rad * sigma_encoder_rad, 1e-10);
  const Eigen::Matrix3d Q = Eigen::Vector3d(1e-8, model.is_rate_plant ? 1e-5 : 0.0, drift * drift).asDiagonal();
  Eigen::Matrix3d P = Q;
  Eigen::Vector3d K = Eigen::Vector3d::Zero();
  for (int i = 0; i < 1000; ++i) {  // converges within tens of steps
    P = F * P * F.transpose() + Q;
    K = P.col(0) / (P(0, 0) + R);
    P -= K * P.row(0).eval();
    P = (0.5 * (P + P.transpose())).eval();
  }
  return K;
}

}  // namespace

AxisObserver::AxisObserver(const ServoAxis& axis, const AxisModel& model, double sigma_encoder_rad)
    : plant_(axis, {}), period_s_(model.period_s), gain_(kalman_gain(model, gain_of(axis.plant), sigma_encoder_rad)) {}

void AxisObserver::start(double encoder_rad) {
  plant_.set_motion({encoder_rad, 0.0});
  disturbance_ = 0.0;
}

void AxisObserver::update(double encoder_rad) {
  plant_.advance(period_s_, disturbance_);
  const AxisMotion& expected = plant_.motion();
  const double nu = encoder_rad - expected.angle_rad;
  disturbance_ += gain_[2] * nu;
  plant_.set_motion({expected.angle_rad + gain_[0] * nu, expected.rate_rad_s + gain_[1] * nu});
}

Eigen::Vector2d AxisObserver::state_at_effect() const {
  const bool is_rate_plant = std::holds_alternative<RatePlant>(plant_.axis().plant);
  DelayedAxis then = plant_;
  if (then.axis().command_delay_s > 0.0) then.advance(then.axis().command_delay_s, disturbance_);
  return {then.motion().angle_rad, is_rate_plant ? then.motion().rate_rad_s : 0.0};
}

}  // namespace alidade
