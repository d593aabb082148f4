#pragma once

#include <Eigen/Core>
#include <optional>

#include "alidade/servo/axis/axis_mpc.h"
#include "alidade/servo/axis/axis_observer.h"
#include "alidade/servo/config.h"

namespace alidade {

/// Input of the controller of one axis at one sample.
struct AxisInput {
  double encoder_rad = 0.0;
  double error_rad = 0.0;  ///< From the newest image: offset of the target over the focal length, > 0 towards + angle.
  /// Where the axis should point from the time a command takes effect, one sample apart; none: stay.
  std::optional<Eigen::Vector<double, mpc_horizon + 1>> wanted_rad;
  Eigen::Vector<double, mpc_horizon + 1> wanted_rate_rad_s = Eigen::Vector<double, mpc_horizon + 1>::Zero();
};

/// From errors and predictions of one axis to its commands; docs/maths/servo.md, section "Controllers". Gains in
/// radians. Allocates no memory after construction.
class AxisController {
 public:
  AxisController(const ServoConfig& config, const ServoAxis& axis, double focal_px);

  /// To be called once per period; the first call uses the encoder reading as the initial state.
  double command(const AxisInput& input);

 private:
  double pi_command(double error_rad);
  double feedforward_on_angle(const AxisInput& input);
  double feedforward_on_rate(const AxisInput& input) const;
  [[nodiscard]] double lqr_command(const AxisInput& input) const;

  ControllerKind kind_;
  PiGains gains_;  ///< Per radian.
  double rate_gain_per_s_;
  AxisModel model_;
  Eigen::RowVector2d lqr_gain_;
  AxisMpc mpc_;
  AxisObserver observer_;
  DelayedAxis expected_;  ///< Motion of the axis if it were as known: the reference of feedforward.
  double dead_band_;
  double integral_ = 0.0;
  bool has_started_ = false;
};

}  // namespace alidade
