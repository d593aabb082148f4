#pragma once

#include <Eigen/Core>

#include "alidade/servo/axis/axis_model.h"

namespace alidade {

/// Disturbance observer of an axis: angle, rate, and the input disturbance that explains the difference from its model,
/// from its encoder; gains of the stationary Kalman filter. That makes a controller free of offset where gain or time
/// constant are not as known. G. Pannocchia & J. B. Rawlings, "Disturbance models for offset-free model-predictive
/// control", 2003.
class AxisObserver {
 public:
  AxisObserver(const ServoAxis& axis, const AxisModel& model, double sigma_encoder_rad);

  void start(double encoder_rad);
  /// To what the encoder reads one period later.
  void update(double encoder_rad);
  void send(double command) { plant_.send(command); }
  /// (angle, rate) when a command that is sent now begins to act.
  [[nodiscard]] Eigen::Vector2d state_at_effect() const;
  /// As if so much had been added to the command.
  [[nodiscard]] double disturbance() const { return disturbance_; }

 private:
  DelayedAxis plant_;
  double period_s_;
  Eigen::Vector3d gain_;
  double disturbance_ = 0.0;
};

}  // namespace alidade
