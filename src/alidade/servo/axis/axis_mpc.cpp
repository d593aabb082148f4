#include "alidade/servo/axis/axis_mpc.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr int n = mpc_horizon;
constexpr int max_sweeps = 40;  // 5 µs; the remaining error is a fraction of the command's noise
constexpr double unbounded = std::numeric_limits<double>::infinity();

}  // namespace

AxisMpc::AxisMpc(const ServoAxis& axis, const AxisModel& model, double command_weight)
    : axis_(axis), model_(model), weight_(command_weight * effect_of_command(model) * effect_of_command(model)) {
  angle_per_command_.setZero();
  rate_per_command_.setZero();
  for (int at = 0; at < n; ++at) {
    Eigen::Vector2d effect = model.B;
    for (int i = at; i < n; ++i) {
      angle_per_command_(i, at) = effect[0];
      rate_per_command_(i, at) = effect[1];
      effect = (model.A * effect).eval();
    }
  }
  Eigen::Matrix<double, n, n> H = angle_per_command_.transpose() * angle_per_command_;
  H.diagonal().array() += weight_;
  inverse_hessian_ = inverse_symmetric(H);
  const double gain = gain_of(axis.plant);
  rows_.setZero();
  rows_.topRows<n>().diagonal().setConstant(gain);  // g u
  if (model.is_rate_plant) {                        // g u_i − ω_i: acceleration times the lag
    rows_.middleRows<n>(n).diagonal().setConstant(gain);
    rows_.middleRows<n - 1>(n + 1) -= rate_per_command_.topRows<n - 1>();
  }
  rows_.bottomRows<n>() = angle_per_command_;
  step_per_multiplier_ = inverse_hessian_ * rows_.transpose();
  for (int i = 0; i < num_rows; ++i) curvature_[i] = rows_.row(i).dot(step_per_multiplier_.col(i));
}

void AxisMpc::set_bounds(const Eigen::Vector2d& state, double disturbance, const Horizon& free_angle,
                         const Horizon& free_rate) {
  low_.setConstant(-unbounded);
  high_.setConstant(unbounded);
  const double added = gain_of(axis_.plant) * disturbance;
  if (const auto* plant = std::get_if<RatePlant>(&axis_.plant)) {
    low_.head<n>().setConstant(-plant->max_rate_rad_s - added);
    high_.head<n>().setConstant(plant->max_rate_rad_s - added);
    const double reach = plant->tau_s * plant->max_acceleration_rad_s2;
    for (int i = 0; i < n; ++i) {
      const double rate = i == 0 ? state[1] : free_rate[i - 1];
      low_[n + i] = rate - reach - added;
      high_[n + i] = rate + reach - added;
    }
  } else {
    low_.head<n>().setConstant(axis_.min_rad - added);
    high_.head<n>().setConstant(axis_.max_rad - added);
  }
  low_.tail<n>() = axis_.min_rad - free_angle.array();
  high_.tail<n>() = axis_.max_rad - free_angle.array();
}

void AxisMpc::ascend(Horizon& commands) {
  for (int i = 0; i < num_rows; ++i) {  // warm start: the constraints that were active last time
    if (!(curvature_[i] > 0.0) || (low_[i] == -unbounded && high_[i] == unbounded)) multipliers_[i] = 0.0;
  }
  commands.noalias() -= step_per_multiplier_ * multipliers_;
  for (sweeps_ = 0; sweeps_ < max_sweeps; ++sweeps_) {
    double largest = 0.0;
    for (int i = 0; i < num_rows; ++i) {
      if (!(curvature_[i] > 0.0)) continue;
      const double value = rows_.row(i).dot(commands), alone = value + curvature_[i] * multipliers_[i];
      const double bound = std::clamp(alone, low_[i], high_[i]);
      const double next = (alone - bound) / curvature_[i], change = next - multipliers_[i];
      if (change == 0.0) continue;
      commands -= change * step_per_multiplier_.col(i);
      multipliers_[i] = next;
      largest = std::max(largest, std::abs(change) * curvature_[i]);
    }
    if (largest < 1e-7) break;  // rad and rad/s
  }
}

double AxisMpc::command(const Eigen::Vector2d& state, double disturbance,
                        const Eigen::Vector<double, n + 1>& wanted_rad,
                        const Eigen::Vector<double, n + 1>& wanted_rate_rad_s) {
  Horizon free_angle, free_rate, staying;
  Eigen::Vector2d free = state;
  for (int i = 0; i < n; ++i) {
    free = (model_.A * free + model_.B * disturbance).eval();
    free_angle[i] = free[0];
    free_rate[i] = free[1];
    staying[i] =
        command_between(model_, {wanted_rad[i], wanted_rate_rad_s[i]}, {wanted_rad[i + 1], wanted_rate_rad_s[i + 1]}) -
        disturbance;
  }
  const Horizon pull = angle_per_command_.transpose() * (wanted_rad.tail<n>() - free_angle) + weight_ * staying;
  Horizon commands = inverse_hessian_ * pull;
  set_bounds(state, disturbance, free_angle, free_rate);
  ascend(commands);
  // If the programme has no solution (axis beyond its stop) or was cut short, limits the command to what is possible.
  const double gain = gain_of(axis_.plant);
  double low = low_[0], high = high_[0];
  if (model_.is_rate_plant && std::max(low, low_[n]) <= std::min(high, high_[n])) {
    low = std::max(low, low_[n]);
    high = std::min(high, high_[n]);
  }
  return std::clamp(gain * commands[0], low, high) / gain;
}

}  // namespace alidade
