#include "alidade/pantilt/positioner.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

constexpr double resting_rate_rad_s = 9e-4, near_rad = 2e-6, still_rad_s = 5e-5;

/// Of a constant acceleration, until the rate is `end_rate`.
struct Pull {
  double acceleration, end_rate;
};

/// Whose rate is not the wanted one. Under an acceleration ±a rate² ∓ 2 a · angle stays the same, which gives the rate
/// at which it meets the wanted one, e / τ or √(2a (e − aτ²/2)) of what is left.
Pull pull_of(const PositionerParams& p, double left, double rate, double wanted, double curve) {
  const double a = p.acceleration_rad_s2, end = a * p.time_constant_s, twice = 2.0 * a * left;
  if (rate < wanted) {
    if (rate < 0.0) return {a, 0.0};
    const double energy = rate * rate + twice;
    const double met = energy >= 3.0 * end * end ? std::sqrt(0.5 * (energy - end * end))
                                                 : energy / (end + std::sqrt(end * end + energy));
    return {a, std::min(p.rate_rad_s, met)};
  }
  if (rate <= curve) return {-a, p.rate_rad_s};
  const double over = rate * rate - twice;  // above zero: it cannot stop there any more
  if (over >= 0.0) return {-a, std::sqrt(over)};
  return {-a, -over / (end + std::sqrt(std::max(0.0, end * end + over)))};
}

}  // namespace

double advance_drive(const PositionerParams& params, double goal_rad, double dt_s, DriveMotion& motion) {
  constexpr double same = 1e-10, rounding = 1e-12, shortest_s = 1e-7;  // whatever rounding does, time goes on
  const double a = params.acceleration_rad_s2, tau = params.time_constant_s, top = params.rate_rad_s;
  const double way = goal_rad - motion.angle_rad, bend = a * tau * tau;
  const double side = way == 0.0 ? (motion.rate_rad_s > 0.0 ? -1.0 : 1.0) : std::copysign(1.0, way);
  const double left = std::abs(way), rate = side * motion.rate_rad_s;
  const auto is_within = [&](double reach) { return left <= reach * (1.0 + same) + rounding; };
  const bool is_near = is_within(bend);
  const double curve = is_near ? left / tau : std::sqrt(2.0 * a * (left - 0.5 * bend));
  const double wanted = std::min(top, curve);
  const bool follows = std::abs(rate - wanted) <= same * (a * tau + wanted) + rounding;
  const double bent = top <= a * tau ? top * tau : 0.5 * bend + 0.5 * top * top / a;
  const bool cruises = follows && !is_within(bent);
  if (follows && !cruises && is_near) {
    motion.angle_rad = goal_rad - way * std::exp(-dt_s / tau);
    motion.rate_rad_s = (goal_rad - motion.angle_rad) / tau;
    return dt_s;
  }
  if (cruises && wanted == top) {
    const double lasts_s = std::min(dt_s, (left - bent) / top);
    motion = {motion.angle_rad + side * top * lasts_s, side * top};
    return std::max(lasts_s, std::min(dt_s, shortest_s));
  }
  const double now = follows ? wanted : rate;
  const Pull pull = follows ? Pull{-a, a * tau} : pull_of(params, left, rate, wanted, curve);
  const double whole_s = std::max((pull.end_rate - now) / pull.acceleration, 0.0), lasts_s = std::min(dt_s, whole_s);
  const double next = lasts_s < whole_s ? now + pull.acceleration * lasts_s : pull.end_rate;
  const bool passes = pull.acceleration < 0.0 && rate > curve && rate * rate >= 2.0 * a * left && lasts_s == whole_s;
  motion.angle_rad = passes ? goal_rad : motion.angle_rad + side * 0.5 * (now + next) * lasts_s;
  motion.rate_rad_s = side * next;
  return std::max(lasts_s, std::min(dt_s, shortest_s));
}

Positioner::Positioner(const PositionerParams& params, double start_rad, double t_s)
    : params_(params), t_(t_s), target_(start_rad), output_(start_rad), motor_{start_rad, 0.0} {}

void Positioner::go_to(double t_s, double target_rad) {
  waiting_.push_back({t_s + params_.latency_s, target_rad, false});
}

void Positioner::stop(double t_s) { waiting_.push_back({t_s + params_.latency_s, 0.0, true}); }

void Positioner::cut(double t_s) {
  waiting_.clear();
  waiting_.push_back({t_s, 0.0, true});
}

void Positioner::come_to_rest() {
  motor_.rate_rad_s = 0.0;
  is_at_rest_ = true;
  is_stopping_ = false;
}

void Positioner::act(const Waiting& command) {
  is_at_rest_ = false;
  is_stopping_ = command.is_stop;
  if (command.is_stop) return;
  target_ = command.target_rad;
  const bool is_still = std::abs(motor_.rate_rad_s) < resting_rate_rad_s;
  if (std::abs(target_ - motor_.angle_rad) > params_.dead_band_rad || !is_still) return;
  target_ = motor_.angle_rad;
  come_to_rest();
}

void Positioner::move(double until_s) {
  while (t_ < until_s && !is_at_rest_) {
    if (is_stopping_) {
      const double rate = motor_.rate_rad_s, whole_s = std::abs(rate) / params_.acceleration_rad_s2;
      const double lasts_s = std::min(until_s - t_, whole_s);
      const bool has_stopped = lasts_s == whole_s;
      const double next = has_stopped ? 0.0 : rate - std::copysign(params_.acceleration_rad_s2 * lasts_s, rate);
      motor_ = {motor_.angle_rad + 0.5 * (rate + next) * lasts_s, next};
      t_ = lasts_s < until_s - t_ ? t_ + lasts_s : until_s;
      if (has_stopped) target_ = motor_.angle_rad, come_to_rest();
    } else {
      const double lasts_s = advance_drive(params_, target_, until_s - t_, motor_);
      t_ = lasts_s < until_s - t_ ? t_ + lasts_s : until_s;
      if (std::abs(target_ - motor_.angle_rad) < near_rad && std::abs(motor_.rate_rad_s) < still_rad_s) come_to_rest();
    }
    const double half = 0.5 * params_.backlash_rad;
    output_ = std::clamp(output_, motor_.angle_rad - half, motor_.angle_rad + half);
  }
  t_ = std::max(t_, until_s);
}

void Positioner::advance(double t_s) {
  while (t_ < t_s) {
    while (!waiting_.empty() && waiting_.front().acts_s <= t_) {
      act(waiting_.front());
      waiting_.pop_front();
    }
    move(waiting_.empty() ? t_s : std::min(t_s, waiting_.front().acts_s));
  }
}

std::vector<double> positioner_response(const PositionerParams& params, double start_rad,
                                        std::span<const PositionCommand> commands, std::span<const double> times_s) {
  std::vector<double> answers;
  if (times_s.empty()) return answers;
  const double first_s = commands.empty() ? times_s.front() : std::min(times_s.front(), commands.front().t_s);
  Positioner axis(params, start_rad, first_s);
  for (const PositionCommand& command : commands) axis.go_to(command.t_s, command.target_rad);
  for (const double t_s : times_s) {
    axis.advance(t_s);
    answers.push_back(axis.output_rad());
  }
  return answers;
}

}  // namespace alidade
