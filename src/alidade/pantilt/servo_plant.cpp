#include "alidade/pantilt/servo_plant.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/pantilt/positioner.h"

namespace alidade {
namespace {

/// As a `Positioner`'s drive.
AxisMotion braking(const AnglePlant& plant, const AxisMotion& motion, double goal, double dt_s) {
  const PositionerParams params{.rate_rad_s = plant.max_rate_rad_s,
                                .acceleration_rad_s2 = plant.max_acceleration_rad_s2,
                                .time_constant_s = plant.tau_s};
  DriveMotion drive{motion.angle_rad, motion.rate_rad_s};
  for (double left_s = dt_s; left_s > 0.0;) left_s -= advance_drive(params, goal, left_s, drive);
  return {drive.angle_rad, drive.rate_rad_s};
}

/// Two phases: as fast as possible until the lag requires less, then the lag.
AxisMotion advanced(const AnglePlant& plant, const AxisMotion& motion, double command, double dt_s) {
  const double goal = plant.gain_rad() * command, missing = goal - motion.angle_rad;
  if (std::isfinite(plant.max_acceleration_rad_s2)) return braking(plant, motion, goal, dt_s);
  const double most = plant.max_rate_rad_s;
  const double fast_s =
      std::isfinite(most) ? std::clamp((std::abs(missing) - plant.tau_s * most) / most, 0.0, dt_s) : 0.0;
  const double left = fast_s > 0.0 ? missing - std::copysign(most * fast_s, missing) : missing;
  const double angle = goal - std::exp(-(dt_s - fast_s) / plant.tau_s) * left;
  return {angle, dt_s > 0.0 ? (angle - motion.angle_rad) / dt_s : motion.rate_rad_s};
}

/// Two phases: at full acceleration until the lag requires less, then the lag.
AxisMotion advanced(const RatePlant& plant, const AxisMotion& motion, double command, double dt_s) {
  const double goal = std::clamp(plant.gain_rad() * command, -plant.max_rate_rad_s, plant.max_rate_rad_s);
  const double missing = goal - motion.rate_rad_s;
  const double reach = plant.tau_s * plant.max_acceleration_rad_s2;  // a smaller gap is closed by the lag alone
  const double hard_s = std::min(dt_s, std::max(0.0, (std::abs(missing) - reach) / plant.max_acceleration_rad_s2));
  const double acceleration = std::copysign(plant.max_acceleration_rad_s2, missing);
  AxisMotion next{motion.angle_rad + (motion.rate_rad_s + 0.5 * acceleration * hard_s) * hard_s,
                  motion.rate_rad_s + acceleration * hard_s};
  const double lag_s = dt_s - hard_s, decay = std::exp(-lag_s / plant.tau_s), gap = next.rate_rad_s - goal;
  next.angle_rad += goal * lag_s + gap * plant.tau_s * (1.0 - decay);
  next.rate_rad_s = goal + gap * decay;
  return next;
}

/// (1/τ) ∫ exp(−(t−s)/τ) exp(−s/λ) ds over a time t: what a lag τ makes of one that decays with λ, also of equal ones.
double response_to_decay(double tau_s, double lag_s, double t_s) {
  const double apart = t_s * std::abs(1.0 / tau_s - 1.0 / lag_s);
  const double mean = apart > 0.0 ? -std::expm1(-apart) / apart : 1.0;
  return t_s / tau_s * std::exp(-t_s / std::max(tau_s, lag_s)) * mean;
}

bool is_linear(const ServoAxis& axis) {
  const auto* plant = std::get_if<AnglePlant>(&axis.plant);  // a rate always has limits
  return plant != nullptr && std::isinf(plant->max_rate_rad_s) && std::isinf(plant->max_acceleration_rad_s2) &&
         std::isinf(axis.min_rad) && std::isinf(axis.max_rad) && !(axis.backlash_rad > 0.0);
}

}  // namespace

double radians_in(AngleUnit unit) { return unit == AngleUnit::deg ? degree : 1.0; }

std::string_view unit_name(AngleUnit unit) { return unit == AngleUnit::deg ? "deg" : "rad"; }

std::optional<AngleUnit> unit_named(std::string_view name) {
  for (const AngleUnit unit : {AngleUnit::deg, AngleUnit::rad})
    if (unit_name(unit) == name) return unit;
  return std::nullopt;
}

AxisMotion advanced(const ServoAxis& axis, const AxisMotion& motion, double command, double dt_s) {
  AxisMotion next = std::visit([&](const auto& plant) { return advanced(plant, motion, command, dt_s); }, axis.plant);
  if (next.angle_rad < axis.min_rad || next.angle_rad > axis.max_rad)
    next = {std::clamp(next.angle_rad, axis.min_rad, axis.max_rad), 0.0};
  return next;
}

LaggedMotion advanced_behind_lag(const ServoPlant& plant, double lag_s, const LaggedMotion& from, double command,
                                 double dt_s) {
  const double tau_s = tau_of(plant), gain = gain_of(plant), goal = gain * command, away = from.lagged - command;
  const double lag_rise = -std::expm1(-dt_s / lag_s), decay = std::exp(-dt_s / tau_s);
  const double pulled = goal + gain * away * response_to_decay(tau_s, lag_s, dt_s);
  LaggedMotion next{from.motion, command + away * (1.0 - lag_rise)};
  if (std::holds_alternative<AnglePlant>(plant)) {
    next.motion.angle_rad = pulled + decay * (from.motion.angle_rad - goal);
    if (dt_s > 0.0) next.motion.rate_rad_s = (next.motion.angle_rad - from.motion.angle_rad) / dt_s;
  } else {  // τ ω' = g u − ω, summed over the time
    next.motion.rate_rad_s = pulled + decay * (from.motion.rate_rad_s - goal);
    next.motion.angle_rad +=
        goal * dt_s + gain * away * lag_s * lag_rise - tau_s * (next.motion.rate_rad_s - from.motion.rate_rad_s);
  }
  return next;
}

double tau_of(const ServoPlant& plant) {
  return std::visit([](const auto& p) { return p.tau_s; }, plant);
}

double gain_of(const ServoPlant& plant) {
  return std::visit([](const auto& p) { return p.gain_rad(); }, plant);
}

ServoPlant scaled(const ServoPlant& plant, double gain_factor, double tau_factor) {
  ServoPlant result = plant;
  std::visit(
      [&](auto& p) {
        p.gain *= gain_factor;
        p.tau_s *= tau_factor;
      },
      result);
  return result;
}

double past_dead_band(double command, double dead_band) {
  return std::copysign(std::max(0.0, std::abs(command) - dead_band), command);
}

ServoAxis linear_part(const ServoAxis& axis) {
  ServoAxis linear = axis;
  linear.dead_band = linear.backlash_rad = linear.second_tau_s = 0.0;
  return linear;
}

void DelayedAxis::move_behind_lag(double dt_s, double goal) {
  const double lag_s = axis_.second_tau_s;
  if (is_linear(axis_)) {
    const LaggedMotion next = advanced_behind_lag(axis_.plant, lag_s, {motion_, lagged_}, goal, dt_s);
    motion_ = next.motion;
    lagged_ = next.lagged;
    return;
  }
  constexpr double per_tau = 20.0, max_steps = 4096.0;
  const double steps = std::clamp(std::ceil(per_tau * dt_s / std::min(lag_s, tau_of(axis_.plant))), 1.0, max_steps);
  const double step_s = dt_s / steps, rise = -std::expm1(-step_s / lag_s);
  for (double k = 0.0; k < steps; ++k) {
    motion_ = advanced(axis_, motion_, goal + (lagged_ - goal) * rise * lag_s / step_s, step_s);
    lagged_ += rise * (goal - lagged_);
  }
}

void DelayedAxis::move(double dt_s, double command) {
  const double goal = past_dead_band(command, axis_.dead_band);
  if (axis_.second_tau_s > 0.0 && dt_s > 0.0)
    move_behind_lag(dt_s, goal);
  else
    motion_ = advanced(axis_, motion_, goal, dt_s);
  const double half = 0.5 * axis_.backlash_rad;
  const double angle = std::clamp(driven_.angle_rad, motion_.angle_rad - half, motion_.angle_rad + half);
  driven_ = {angle, half > 0.0 && angle == driven_.angle_rad ? 0.0 : motion_.rate_rad_s};
}

void DelayedAxis::send(double command) {
  if (axis_.command_delay_s <= 0.0) {
    command_ = command;
    return;
  }
  if (num_waiting_ == waiting_.size()) {
    command_ = waiting_[0].command;
    std::copy(waiting_.begin() + 1, waiting_.end(), waiting_.begin());
    --num_waiting_;
  }
  waiting_[num_waiting_++] = {axis_.command_delay_s, command};
}

void DelayedAxis::advance(double dt_s, double added) {
  std::size_t num_done = 0;
  double now_s = 0.0;
  for (; num_done < num_waiting_ && waiting_[num_done].in_s <= dt_s; ++num_done) {
    move(waiting_[num_done].in_s - now_s, command_ + added);
    now_s = waiting_[num_done].in_s;
    command_ = waiting_[num_done].command;
  }
  move(dt_s - now_s, command_ + added);
  num_waiting_ -= num_done;
  for (std::size_t i = 0; i < num_waiting_; ++i)
    waiting_[i] = {waiting_[i + num_done].in_s - dt_s, waiting_[i + num_done].command};
}

}  // namespace alidade
