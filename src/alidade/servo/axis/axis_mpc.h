#pragma once

#include <Eigen/Core>

#include "alidade/servo/axis/axis_model.h"

namespace alidade {

inline constexpr int mpc_horizon = 10;
using Horizon = Eigen::Vector<double, mpc_horizon>;

/// Commands of the next 10 samples that minimise Σ (angle − wanted)² + weight · effect² · Σ (command − the command that
/// stays on the wanted angles)², subject to limits of rate, acceleration and angle. Condensed
/// quadratic programme; its dual by coordinate ascent, in fixed memory: C. Hildreth, "A quadratic programming
/// procedure", 1957; bounds on both sides: A. Lent & Y. Censor, 1980.
class AxisMpc {
 public:
  AxisMpc(const ServoAxis& axis, const AxisModel& model, double command_weight);

  /// From this state and with this disturbance of the command; `wanted[0]` is now, `wanted[i]` is i samples later, with
  /// the current rate. Returns the first command; it never exceeds the limits of the axis.
  [[nodiscard]] double command(const Eigen::Vector2d& state, double disturbance,
                               const Eigen::Vector<double, mpc_horizon + 1>& wanted_rad,
                               const Eigen::Vector<double, mpc_horizon + 1>& wanted_rate_rad_s);
  [[nodiscard]] int sweeps() const { return sweeps_; }  ///< For the last command.

 private:
  static constexpr int num_rows = 3 * mpc_horizon;  // effort, acceleration, angle
  using Rows = Eigen::Vector<double, num_rows>;

  void set_bounds(const Eigen::Vector2d& state, double disturbance, const Horizon& free_angle,
                  const Horizon& free_rate);
  void ascend(Horizon& commands);

  ServoAxis axis_;
  AxisModel model_;
  double weight_;
  Eigen::Matrix<double, mpc_horizon, mpc_horizon> angle_per_command_, rate_per_command_, inverse_hessian_;
  Eigen::Matrix<double, num_rows, mpc_horizon, Eigen::RowMajor> rows_;
  Eigen::Matrix<double, mpc_horizon, num_rows> step_per_multiplier_;
  Rows curvature_, low_, high_, multipliers_ = Rows::Zero();
  int sweeps_ = 0;
};

}  // namespace alidade
