#pragma once

#include <Eigen/Core>

#include "alidade/servo/axis/axis_model.h"

namespace alidade {

/// Disturbance observer of an axis: angle, rate, and the input disturbance that explains the difference between model
/// and encoder; stationary Kalman gains. It makes a controller free of offset if gain or time
/// constant are not as assumed. G. Pannocchia & J. B. Rawlings, "Disturbance models for offset-free model-predictive
/// control", 2003.
class AxisObserver {
 public:
  AxisObserver(const ServoAxis& axis, const AxisModel& model, double sigma_encoder_rad);

  void start(double encoder_rad);
  /// Update with the encoder reading one period later.
  void update(double encoder_rad);
  void send(double command) { plant_.send(command); }
  /// (angle, rate) at the time at which a command sent now takes effect.
  [[nodiscard]] Eigen::Vector2d state_at_effect() const;
  /// Equivalent disturbance, added to the command.
  [[nodiscard]] double disturbance() const { return disturbance_; }

 private:
  DelayedAxis plant_;
  double period_s_;
  Eigen::Vector3d gain_;
  double disturbance_ = 0.0;
};

}  // namespace alidade
