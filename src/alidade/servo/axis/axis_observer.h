#pragma once

#include <Eigen/Core>

#include "alidade/servo/axis/axis_model.h"

namespace alidade {

/// What an axis does beside what its model says: angle, rate, and the command that the difference amounts to, from its
/// encoder; the gains are the stationary Kalman filter's. That makes a controller free of offset where gain or time
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
