#include <algorithm>
#include <cmath>
#include <optional>

#include "alidade/pantilt/positioner.h"
#include "alidade/pantilt/servo_plant.h"
#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

using Eigen::Index;

constexpr double no_limit = 1e9;

/// Solution after time t of ds/dt = −s / (1 + |s|) from s(0): ln |s| + |s| decreases
/// by t. Lambert's W by a fourth-order iteration: F. N. Fritsch, R. E. Shafer & W.
/// P. Crowley, "Solution of the transcendental equation we^w = x", 1973.
double soft_decay(double s, double t) {
  constexpr int max_steps = 10;
  constexpr double tiny = 1e-300, near = 1e-4;
  const double before = std::abs(s);
  if (!(before > tiny)) return s;
  const double sum = std::log(before) + before - t;
  const double most = std::exp(std::min(sum, 0.0));
  double left = sum > 1.0 ? sum - std::log(sum) : most / (1.0 + most);
  for (int i = 0; i < max_steps; ++i) {
    const double z = sum - std::log(left) - left, q = 2.0 * (1.0 + left) * (1.0 + left + 2.0 / 3.0 * z);
    const double by = z / (1.0 + left) * (q - z) / (q - 2.0 * z);
    left *= 1.0 + by;
    if (std::abs(by) < near) break;  // the remaining error is its fourth power
  }
  return std::copysign(left, s);
}

/// State of a simulated servo during the log: an axis with fitted gain and flaws, with commands relative to zero.
class FlawedServo {
 public:
  FlawedServo(const ServoFit& fit, const ServoFlaws& flaws, double first_command, double max_command)
      : fit_(fit),
        flaws_(flaws),
        is_limited_(flaws.max_rate_rad_s > 0.0 || flaws.max_acceleration_rad_s2 > 0.0),
        is_plain_(!is_limited_ && !(flaws.second_tau_s > 0.0) && !(flaws.soft_max_rate_rad_s > 0.0) &&
                  !(flaws.resonance_hz > 0.0)),
        max_command_(max_command),
        gain_(fit.params[ServoParam::gain]),
        tau_s_(fit.params[ServoParam::tau]),
        decays_(tau_s_),
        command_(first_command),
        goal_(goal_of(first_command, 0.0)),
        lagged_(goal_) {
    const double max_rate = flaws.max_rate_rad_s > 0.0 ? flaws.max_rate_rad_s : no_limit;
    if (fit.kind == ServoKind::angle) {
      AnglePlant plant{fit.params[ServoParam::gain], AngleUnit::rad, fit.params[ServoParam::tau]};
      if (flaws.max_rate_rad_s > 0.0) plant.max_rate_rad_s = max_rate;
      if (flaws.max_acceleration_rad_s2 > 0.0) plant.max_acceleration_rad_s2 = flaws.max_acceleration_rad_s2;
      axis_.plant = plant;
      now_.angle_rad = fit.params[ServoParam::start];
    } else {
      RatePlant plant{fit.params[ServoParam::gain], AngleUnit::rad, fit.params[ServoParam::tau]};
      plant.max_rate_rad_s = max_rate;
      plant.max_acceleration_rad_s2 = flaws.max_acceleration_rad_s2 > 0.0 ? flaws.max_acceleration_rad_s2 : no_limit;
      axis_.plant = plant;
      now_.rate_rad_s = fit.params[ServoParam::start];
    }
    read_ = now_.angle_rad;
    if (flaws.resonance_hz > 0.0)
      swinging_.emplace(Mode{flaws.resonance_hz, flaws.resonance_damping, flaws.resonance_share},
                        DriveMotion{now_.angle_rad, now_.rate_rad_s});
  }
  [[nodiscard]] double read_rad() const { return read_; }

  /// `share`: current position in the log, from 0 to 1.
  void advance(double dt_s, double command, double share) {
    if (!(dt_s > 0.0)) return;
    if (command != command_ || flaws_.gain_drift != 0.0) {
      command_ = command;
      goal_ = goal_of(command, share);
    }
    const double goal = goal_, lag_s = flaws_.second_tau_s;
    turned_ += flaws_.rate_offset_rad_s * dt_s;
    if (is_plain_) {
      move_unlimited(dt_s, goal);
      read();
      return;
    }
    if (!(lag_s > 0.0)) {
      move(dt_s, goal);
      return;
    }
    if (!is_limited_ && !(flaws_.backlash_rad > 0.0) && !swinging_ && !is_soft()) {
      const LaggedMotion next = advanced_behind_lag(axis_.plant, lag_s, {now_, lagged_}, goal, dt_s);
      now_ = next.motion;
      lagged_ = next.lagged;
      read();
      return;
    }
    constexpr double per_tau = 20.0, max_steps = 40.0;
    const double shortest_s = std::min(lag_s, fit_.params[ServoParam::tau]);
    const double steps = std::clamp(std::ceil(per_tau * dt_s / shortest_s), 1.0, max_steps), step_s = dt_s / steps;
    const double rise = -std::expm1(-step_s / lag_s);
    for (double k = 0.0; k < steps; ++k) {
      move(step_s, goal + (lagged_ - goal) * rise * lag_s / step_s);
      lagged_ += rise * (goal - lagged_);
    }
  }

 private:
  /// The command that gives the same motion with an axis of the stated gain.
  [[nodiscard]] double goal_of(double command, double share) const {
    if (flaws_.max_command > 0.0) command = std::clamp(command, -flaws_.max_command, flaws_.max_command);
    const double difference = command > 0.0 ? flaws_.gain_difference : -flaws_.gain_difference;
    double goal =
        past_dead_band(command, flaws_.dead_band) * (1.0 + difference) * (1.0 + flaws_.gain_drift * (share - 0.5));
    if (flaws_.gain_by_size != 0.0) goal *= 1.0 + flaws_.gain_by_size * (std::abs(command) / max_command_ - 0.5);
    if (fit_.kind == ServoKind::rate && is_soft()) {
      const double gain = fit_.params[ServoParam::gain];
      goal = softened(gain * goal) / gain;
    }
    return goal;
  }

  /// Whether the rate saturates gradually.
  [[nodiscard]] bool is_soft() const { return flaws_.soft_max_rate_rad_s > 0.0; }
  [[nodiscard]] double softened(double rate_rad_s) const {
    return is_soft() ? rate_rad_s / (1.0 + std::abs(rate_rad_s) / flaws_.soft_max_rate_rad_s) : rate_rad_s;
  }

  /// Like `advanced`, without limits and with cached decays: the steps of a log have two lengths.
  void move_unlimited(double dt_s, double command) {
    if (is_soft() && fit_.kind == ServoKind::angle) {
      const double reach = fit_.params[ServoParam::tau] * flaws_.soft_max_rate_rad_s;
      const double goal = fit_.params[ServoParam::gain] * command;
      now_.angle_rad = goal + reach * soft_decay((now_.angle_rad - goal) / reach, dt_s / fit_.params[ServoParam::tau]);
      return;
    }
    const auto [step_s, decay, rise] = decays_.over(dt_s);
    const double goal = gain_ * command;
    if (fit_.kind == ServoKind::angle) {
      now_.angle_rad = goal + decay * (now_.angle_rad - goal);
    } else {
      const double gap = now_.rate_rad_s - goal;
      now_.angle_rad += goal * dt_s + gap * tau_s_ * rise;
      now_.rate_rad_s = goal + decay * gap;
    }
  }

  /// In short steps where the drive may reverse within one, so that the backlash follows.
  void move(double dt_s, double goal) {
    if (!is_soft() || !is_limited_ || fit_.kind == ServoKind::rate) {
      move_hard(dt_s, goal);
      return;
    }
    constexpr double per_tau = 20.0, max_steps = 40.0;
    const double tau_s = fit_.params[ServoParam::tau], gain = fit_.params[ServoParam::gain];
    const double steps = std::clamp(std::ceil(per_tau * dt_s / tau_s), 1.0, max_steps);
    for (double k = 0.0; k < steps; ++k) {
      const double rate = softened((gain * goal - now_.angle_rad) / tau_s);
      move_hard(dt_s / steps, (now_.angle_rad + tau_s * rate) / gain);
    }
  }
  void move_hard(double dt_s, double goal) {
    const auto* braking = std::get_if<AnglePlant>(&axis_.plant);
    if (braking == nullptr || !std::isfinite(braking->max_acceleration_rad_s2)) {
      lag(dt_s, goal);
      return;
    }
    const PositionerParams drive{.rate_rad_s = braking->max_rate_rad_s,
                                 .acceleration_rad_s2 = braking->max_acceleration_rad_s2,
                                 .time_constant_s = braking->tau_s};
    DriveMotion motion{now_.angle_rad, now_.rate_rad_s};
    while (dt_s > 0.0) {
      const DriveMotion before = motion;
      const double step_s = advance_drive(drive, braking->gain * goal, dt_s, motion);
      dt_s -= step_s;
      now_ = {motion.angle_rad, motion.rate_rad_s};
      if (swinging_) swinging_->advance(step_s, before, motion);
      read();
    }
  }
  /// The resonance approximates the drive's motion by a cubic: over a quarter of its time constant accurate to 10⁻⁵.
  void lag(double dt_s, double goal) {
    constexpr double per_tau = 4.0, max_steps = 40.0;
    const double tau_s = fit_.params[ServoParam::tau];
    const double steps = swinging_ ? std::clamp(std::ceil(per_tau * dt_s / tau_s), 1.0, max_steps) : 1.0;
    const double step_s = dt_s / steps;
    for (double k = 0.0; k < steps; ++k) {
      const DriveMotion before{now_.angle_rad, swinging_ ? rate_under(goal) : 0.0};
      if (is_limited_)
        now_ = advanced(axis_, now_, goal, step_s);
      else
        move_unlimited(step_s, goal);
      if (swinging_) swinging_->advance(step_s, before, {now_.angle_rad, rate_under(goal)});
      read();
    }
  }
  [[nodiscard]] double rate_under(double goal) const {
    const auto* plant = std::get_if<AnglePlant>(&axis_.plant);
    if (plant == nullptr) return now_.rate_rad_s;
    const double missing = (plant->gain * goal - now_.angle_rad) / plant->tau_s;
    const double rate = is_limited_ ? missing : softened(missing);
    return std::clamp(rate, -plant->max_rate_rad_s, plant->max_rate_rad_s);
  }
  void read() {
    const double half = 0.5 * flaws_.backlash_rad;
    double angle = now_.angle_rad;
    if (swinging_) angle += flaws_.resonance_share * (swinging_->angle_rad() - angle);
    angle += turned_;
    read_ = std::clamp(read_, angle - half, angle + half);
  }

  const ServoFit& fit_;
  const ServoFlaws& flaws_;
  bool is_limited_;
  bool is_plain_;  ///< A step has a closed form.
  double max_command_;
  double gain_, tau_s_;
  Decay decays_;
  ServoAxis axis_;
  AxisMotion now_;
  std::optional<Resonance> swinging_;
  double command_, goal_;  ///< The active command, and its equivalent for an axis of the stated gain.
  double lagged_, read_ = 0.0, turned_ = 0.0;
};

}  // namespace

double largest_command(std::span<const ServoSample> log) {
  double most = 0.0;
  for (const ServoSample& row : log) most = std::max(most, std::abs(row.command));
  return most;
}

Eigen::VectorXd flawed_response(std::span<const ServoSample> log, const ServoFit& fit, const ServoFlaws& flaws) {
  const std::vector<double> times_s = reading_times(log);
  const double begin_s = std::min(log.front().t_s, times_s.front());
  Eigen::VectorXd angles(static_cast<Index>(times_s.size()));
  double now_s = begin_s, command = log.front().command + flaws.earlier_command;
  FlawedServo servo(fit, flaws, command, flaws.gain_by_size != 0.0 ? std::max(largest_command(log), 1e-300) : 1.0);
  const double length_s = std::max(times_s.back() - begin_s, 1e-9);
  const auto advance_to = [&](double until_s) {
    servo.advance(until_s - now_s, command, (0.5 * (now_s + until_s) - begin_s) / length_s);
    now_s = until_s;
  };
  std::size_t next = 0;
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    const double read_s = times_s[i] + flaws.clock_rate * (times_s[i] - begin_s);
    for (; next < log.size() && log[next].given_s() + fit.params[ServoParam::latency] <= read_s; ++next) {
      if (log[next].command == command) continue;
      advance_to(log[next].given_s() + fit.params[ServoParam::latency]);
      command = log[next].command;
    }
    advance_to(read_s);
    angles[static_cast<Index>(i)] = fit.params[ServoParam::zero] + servo.read_rad();
  }
  return angles;
}

}  // namespace alidade
