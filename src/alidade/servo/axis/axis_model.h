#pragma once

#include <Eigen/Core>

#include "alidade/pantilt/servo_plant.h"

namespace alidade {

/// Linear model of one axis between samples: state (angle [rad], rate [rad/s]), next = A state + B command, exact for a
/// held command. For an angle plant the rate is not a state and is zero.
struct AxisModel {
  Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
  Eigen::Vector2d B = Eigen::Vector2d::Zero();
  double period_s = 0.05;
  bool is_rate_plant = false;
};
[[nodiscard]] AxisModel sampled(const ServoPlant& plant, double period_s);

/// Motion of the axis per unit of command within a period, in steady state of the rate: the scale of the effort.
[[nodiscard]] double effect_of_command(const AxisModel& model);

/// Gain K of command = K (wanted − state) that minimises Σ angle error² + weight · (effect_of_command · command)².
/// Iterated Riccati equation; B. D. O. Anderson & J. B. Moore, "Optimal Control", 1990, section 2.4.
[[nodiscard]] Eigen::RowVector2d lqr_gain(const AxisModel& model, double command_weight);

/// Command that moves the model from one wanted (angle, rate) to the next: an angle plant to its angle, a rate plant to
/// its rate.
[[nodiscard]] double command_between(const AxisModel& model, const Eigen::Vector2d& wanted,
                                     const Eigen::Vector2d& next);

}  // namespace alidade
