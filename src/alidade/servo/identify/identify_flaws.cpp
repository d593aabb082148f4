#include "alidade/servo/identify/identify_flaws.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "alidade/geometry/decompositions.h"
#include "alidade/pantilt/positioner.h"
#include "alidade/pantilt/servo_plant.h"
#include "alidade/servo/identify/levenberg.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

using Eigen::Index;

constexpr double no_limit = 1e9;
constexpr double gain_unit = 0.05, max_gain_change = 0.9;  ///< Of a step of one, and at most.
constexpr double offset_unit_rad_s = 0.01;
constexpr double clock_unit = 0.01, max_clock_rate = 0.1;  ///< Of a step of one; beyond it nobody calls it a clock.
constexpr double min_damping = 5e-3, max_damping = 0.98;   ///< Of what swings.

double max_command(std::span<const ServoSample> log) {
  double most = 0.0;
  for (const ServoSample& row : log) most = std::max(most, std::abs(row.command));
  return most;
}

/// A servo half-way through its log: an axis of gain and flaws as fitted, which counts its commands from zero.
class FlawedServo {
 public:
  FlawedServo(const ServoFit& fit, const ServoFlaws& flaws, double first_command, double max_command)
      : fit_(fit),
        flaws_(flaws),
        is_limited_(flaws.max_rate_rad_s > 0.0 || flaws.max_acceleration_rad_s2 > 0.0),
        max_command_(max_command),
        decays_(fit.params[ServoParam::tau]),
        lagged_(goal_of(first_command, 0.0)) {
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

  /// `share`: of the log's length, where this is.
  void advance(double dt_s, double command, double share) {
    if (!(dt_s > 0.0)) return;
    const double goal = goal_of(command, share), lag_s = flaws_.second_tau_s;
    turned_ += flaws_.rate_offset_rad_s * dt_s;
    if (!(lag_s > 0.0)) {
      move(dt_s, goal);
      return;
    }
    if (!is_limited_ && !(flaws_.backlash_rad > 0.0) && !swinging_) {
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
  /// The command that an axis of the stated gain would have to follow.
  [[nodiscard]] double goal_of(double command, double share) const {
    if (flaws_.max_command > 0.0) command = std::clamp(command, -flaws_.max_command, flaws_.max_command);
    const double difference = command > 0.0 ? flaws_.gain_difference : -flaws_.gain_difference;
    double goal =
        past_dead_band(command, flaws_.dead_band) * (1.0 + difference) * (1.0 + flaws_.gain_drift * (share - 0.5));
    if (flaws_.gain_by_size != 0.0) goal *= 1.0 + flaws_.gain_by_size * (std::abs(command) / max_command_ - 0.5);
    return goal;
  }

  /// As `advanced` without limits: the steps of a log have two lengths.
  void move_unlimited(double dt_s, double command) {
    const auto [step_s, decay, rise] = decays_.over(dt_s);
    const double goal = fit_.params[ServoParam::gain] * command;
    if (fit_.kind == ServoKind::angle) {
      now_.angle_rad = goal + decay * (now_.angle_rad - goal);
    } else {
      const double gap = now_.rate_rad_s - goal;
      now_.angle_rad += goal * dt_s + gap * fit_.params[ServoParam::tau] * rise;
      now_.rate_rad_s = goal + decay * gap;
    }
  }

  /// The play follows piece by piece where the drive may turn back within a step.
  void move(double dt_s, double goal) {
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
  /// What swings takes the drive's motion for a cubic: over a quarter of its time constant that is so to 10⁻⁵ of it.
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
    const double rate = (plant->gain * goal - now_.angle_rad) / plant->tau_s;
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
  double max_command_;
  Decay decays_;
  ServoAxis axis_;
  AxisMotion now_;
  std::optional<Resonance> swinging_;
  double lagged_, read_ = 0.0, turned_ = 0.0;
};

/// What a step of one is in a flaw's size: those that have one sign go by factors.
double unit_of(const ServoFit& fit, std::size_t flaw) {
  constexpr double turn_rad = 0.1;
  if (flaw == ServoFlaw::clock_rate) return clock_unit;
  if (is_of_the_gain(flaw)) return gain_unit;
  if (flaw == ServoFlaw::resonance_share) return 1.0;
  if (flaw == ServoFlaw::rate_offset) return offset_unit_rad_s;
  if (flaw == ServoFlaw::earlier_command) return turn_rad / std::max(std::abs(fit.params[ServoParam::gain]), 1e-300);
  return fit.flaws.*servo_flaws[flaw];
}

bool is_linear(std::size_t flaw) {
  return flaw == ServoFlaw::earlier_command || flaw == ServoFlaw::resonance_share || flaw == ServoFlaw::rate_offset;
}

/// What a step of one parameter or freed flaw makes of a fit.
ServoFit moved(const ServoFit& fit, Index param, double by) {
  ServoFit next = fit;
  if (param < num_servo_params) {
    next.params[param] += by;
    next.params = within_meaning(fit.params, next.params);
  } else {
    const std::size_t flaw = fit.freed[static_cast<std::size_t>(param - num_servo_params)];
    double& size = next.flaws.*servo_flaws[flaw];
    if (is_linear(flaw)) {  // the response is linear in it
      size += by * unit_of(fit, flaw);
      return next;
    }
    const double most = flaw == ServoFlaw::resonance ? 0.1 : 1.0;
    by = std::clamp(by, -most, most);
    if (flaw == ServoFlaw::clock_rate)
      size = std::clamp(size + clock_unit * by, -max_clock_rate, max_clock_rate);
    else if (is_of_the_gain(flaw))
      size = std::clamp(size + gain_unit * by, -max_gain_change, max_gain_change);
    else
      size *= std::exp(by);
    if (flaw == ServoFlaw::resonance_damping) size = std::clamp(size, min_damping, max_damping);
    // Of two lags one is the shorter: the second.
    if (flaw == ServoFlaw::second_lag)
      size = std::clamp(size, 0.02 * next.params[ServoParam::tau], next.params[ServoParam::tau]);
  }
  return next;
}

/// By how much a parameter is moved for a difference.
double step_of(std::span<const ServoSample> log, const ServoFit& fit, Index param) {
  const double spacing_s = (log.back().t_s - log.front().t_s) / static_cast<double>(log.size());
  switch (param) {
    case ServoParam::gain:
      return 1e-5 * std::abs(fit.params[ServoParam::gain]);
    case ServoParam::tau:
      return 1e-4 * fit.params[ServoParam::tau];
    case ServoParam::latency:
      return std::min(1e-3 * std::max(fit.params[ServoParam::tau], spacing_s), 0.01 * spacing_s);
    case ServoParam::zero:
    case ServoParam::start:
      return 1e-6;
    default:
      return 1e-4;
  }
}

/// ∂ / ∂ (parameters, freed flaws in units of their own).
Eigen::MatrixXd jacobian_by_factors(std::span<const ServoSample> log, const ServoFit& fit) {
  const auto num = static_cast<Index>(num_servo_params + fit.freed.size());
  Eigen::MatrixXd J(readings_of(log).size(), num);
  for (Index k = 0; k < num; ++k) {
    if (k == ServoParam::zero) {
      J.col(k).setOnes();
      continue;
    }
    const double step = step_of(log, fit, k);
    const bool is_at_edge = k == ServoParam::latency && fit.params[ServoParam::latency] < step;
    const ServoFit more = moved(fit, k, step), less = moved(fit, k, is_at_edge ? 0.0 : -step);
    J.col(k) = (flawed_response(log, more, more.flaws) - flawed_response(log, less, less.flaws)) /
               (is_at_edge ? step : 2.0 * step);
  }
  return J;
}

double max_rate(std::span<const ServoSample> log, const Eigen::VectorXd& response) {
  const std::vector<double> times_s = reading_times(log);
  double most = 0.0;
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    const auto at = static_cast<Index>(i);
    most = std::max(most, std::abs(response[at] - response[at - 1]) / (times_s[i] - times_s[i - 1]));
  }
  return most;
}

std::vector<double> sizes_of(std::span<const ServoSample> log, const ServoFit& fit, const Eigen::VectorXd& response,
                             std::size_t flaw) {
  const auto times = [](double unit, std::initializer_list<double> factors) {
    std::vector<double> sizes;
    for (const double factor : factors) sizes.push_back(unit * factor);
    return sizes;
  };
  switch (flaw) {
    case ServoFlaw::rate_limit:
      return times(max_rate(log, response), {0.99, 0.95, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1});
    case ServoFlaw::acceleration_limit:
      return times(max_rate(log, response) / fit.params[ServoParam::tau], {0.9, 0.7, 0.5, 0.3, 0.15});
    case ServoFlaw::dead_band:
      return times(max_command(log), {0.005, 0.01, 0.02, 0.05, 0.1, 0.2});
    case ServoFlaw::backlash:
      return times(response.maxCoeff() - response.minCoeff(), {0.002, 0.005, 0.01, 0.02, 0.05, 0.1});
    case ServoFlaw::clock_rate:  // by the end a part of the time constant
      return times(fit.params[ServoParam::tau] / (log.back().t_s - log.front().t_s), {-0.2, -0.02, 0.02, 0.2});
    case ServoFlaw::earlier_command:
      return times(max_command(log), {-1.0, 1.0});
    case ServoFlaw::gain_difference:
    case ServoFlaw::gain_drift:
    case ServoFlaw::gain_by_size:  // the response is nearly linear in them
      return times(gain_unit, {-1.0, 1.0});
    case ServoFlaw::command_limit:
      return times(max_command(log), {0.98, 0.9, 0.8, 0.65, 0.5, 0.3});
    case ServoFlaw::rate_offset:
      return times(offset_unit_rad_s, {-1.0, 1.0});
    default:
      return times(fit.params[ServoParam::tau], {0.1, 0.3, 0.6, 1.0});
  }
}

}  // namespace

Eigen::VectorXd flawed_response(std::span<const ServoSample> log, const ServoFit& fit, const ServoFlaws& flaws) {
  const std::vector<double> times_s = reading_times(log);
  const double begin_s = std::min(log.front().t_s, times_s.front());
  Eigen::VectorXd angles(static_cast<Index>(times_s.size()));
  double now_s = begin_s, command = log.front().command + flaws.earlier_command;
  FlawedServo servo(fit, flaws, command, flaws.gain_by_size != 0.0 ? std::max(max_command(log), 1e-300) : 1.0);
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

Eigen::VectorXd flawed_misfit(std::span<const ServoSample> log, const ServoFit& fit) {
  return flawed_response(log, fit, fit.flaws) - readings_of(log);
}

double refine_flawed(std::span<const ServoSample> log, int max_steps, ServoFit& fit) {
  const auto after = [](const ServoFit& from, const Eigen::VectorXd& step) {
    ServoFit next = from;
    for (Index k = 0; k < step.size(); ++k) next = moved(next, k, step[k]);
    return next;
  };
  const LevenbergOutcome descent = levenberg(
      {.max_steps = max_steps, .first_damping = 1e-4, .tolerance = 1e-9, .ridge = 1e-18}, fit,
      [&](const ServoFit& at) { return flawed_misfit(log, at); },
      [&](const ServoFit& at) { return jacobian_by_factors(log, at); }, after);
  fit.has_converged = descent.has_converged;
  const double dof =
      static_cast<double>(readings_of(log).size()) - num_servo_params - static_cast<double>(fit.freed.size());
  fit.rms_rad = std::sqrt(descent.sum2 / std::max(1.0, dof));
  return descent.sum2;
}

Eigen::MatrixXd flawed_jacobian(std::span<const ServoSample> log, const ServoFit& fit) {
  Eigen::MatrixXd J = jacobian_by_factors(log, fit);
  for (std::size_t i = 0; i < fit.freed.size(); ++i)
    J.col(num_servo_params + static_cast<Index>(i)) /= unit_of(fit, fit.freed[i]);
  return J;
}

FlawGround flaw_ground(std::span<const ServoSample> log, const ServoFit& fit) {
  const Eigen::MatrixXd J = jacobian_by_factors(log, fit);
  FlawGround ground{flawed_response(log, fit, fit.flaws), {}, orthonormal_basis(J, J.cols())};
  ground.misfit = flawed_misfit(log, fit);
  return ground;
}

std::vector<FlawScore> flaw_scores(std::span<const ServoSample> log, const ServoFit& fit, const FlawGround& ground,
                                   std::size_t flaw) {
  std::vector<FlawScore> scores;
  if (!is_of_kind(fit.kind, flaw)) return {{}};
  for (const double size : sizes_of(log, fit, ground.response, flaw)) {
    ServoFlaws flaws = fit.flaws;
    flaws.*servo_flaws[flaw] = size;
    Eigen::VectorXd added = flawed_response(log, fit, flaws) - ground.response;
    added -= ground.across * (ground.across.transpose() * added);  // the parameters follow
    const double own2 = added.squaredNorm(), along = -added.dot(ground.misfit);
    // Only in the flaw's own direction, and nothing where the parameters can do all that it does.
    const bool shows = own2 > 1e-3 * fit.rms_rad * fit.rms_rad && along > 0.0;
    scores.push_back({size, shows ? along * along / own2 : 0.0});
  }
  std::ranges::stable_sort(scores, std::ranges::greater{}, &FlawScore::gain2);
  return scores;
}

std::vector<HiddenFlaw> hidden_flaws(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr double share = 0.05, min_evidence = 9.0, min_moved = 0.005;
  const Eigen::VectorXd response = flawed_response(log, fit, fit.flaws);
  const double sum2 = flawed_misfit(log, fit).squaredNorm(), range = response.maxCoeff() - response.minCoeff();
  std::vector<HiddenFlaw> hidden;
  const auto ask = [&](std::size_t flaw, double size) {
    if (std::ranges::count(fit.freed, flaw) > 0 || !(size > 0.0)) return;
    ServoFit trial = fit;
    trial.flaws.*servo_flaws[flaw] = size;
    if (flaw == ServoFlaw::rate_limit && fit.kind == ServoKind::rate) trial.params[ServoParam::gain] *= 1.0 + share;
    const double with2 = refine_flawed(log, 40, trial);
    const double rows = effective_rows(flawed_misfit(log, trial));
    const double factor = trial.params[ServoParam::gain] / fit.params[ServoParam::gain];
    if (rows * std::log(with2 / sum2) < min_evidence && std::abs(factor - 1.0) > min_moved)
      hidden.push_back({flaw, size, factor});
  };
  ask(ServoFlaw::dead_band, share * max_command(log));
  ask(ServoFlaw::backlash, 0.5 * share * range);
  if (fit.kind == ServoKind::rate) ask(ServoFlaw::rate_limit, max_rate(log, response));
  return hidden;
}

}  // namespace alidade
