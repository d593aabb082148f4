#include "alidade/pantilt/positioner.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

constexpr double resting_rate_rad_s = 9e-4, near_rad = 2e-6, still_rad_s = 5e-5;

}  // namespace

Positioner::Positioner(const PositionerParams& params, double start_rad, double t_s, double step_s)
    : params_(params), step_s_(step_s), t_(t_s), target_(start_rad), motor_(start_rad), output_(start_rad) {}

void Positioner::go_to(double t_s, double target_rad) {
  waiting_.push_back({t_s + params_.latency_s, target_rad, false});
}

void Positioner::stop(double t_s) { waiting_.push_back({t_s + params_.latency_s, 0.0, true}); }

void Positioner::cut(double t_s) {
  waiting_.clear();
  waiting_.push_back({t_s, 0.0, true});
}

void Positioner::act(const Waiting& command) {
  is_at_rest_ = false;
  is_stopping_ = command.is_stop;
  if (command.is_stop) return;
  target_ = command.target_rad;
  if (std::abs(target_ - motor_) > params_.dead_band_rad || std::abs(rate_) >= resting_rate_rad_s) return;
  target_ = motor_;
  rate_ = 0.0;
  is_at_rest_ = true;
}

void Positioner::step(double dt_s) {
  const PositionerParams& p = params_;
  double wanted = 0.0;
  if (!is_stopping_) {
    const double e = target_ - motor_, left = std::abs(e);
    const double bend = p.acceleration_rad_s2 * p.time_constant_s * p.time_constant_s;
    const double braking =
        left <= bend ? left / p.time_constant_s : std::sqrt(2.0 * p.acceleration_rad_s2 * (left - 0.5 * bend));
    wanted = std::copysign(std::min(p.rate_rad_s, braking), e);
  }
  const double most = p.acceleration_rad_s2 * dt_s;
  rate_ += std::clamp(wanted - rate_, -most, most);
  motor_ += rate_ * dt_s;
  const double half = 0.5 * p.backlash_rad;
  output_ = std::clamp(output_, motor_ - half, motor_ + half);
  const bool has_stopped = is_stopping_ && rate_ == 0.0;
  const bool has_come = !is_stopping_ && std::abs(target_ - motor_) < near_rad && std::abs(rate_) < still_rad_s;
  if (!has_stopped && !has_come) return;
  if (has_stopped) target_ = motor_;
  rate_ = 0.0;
  is_at_rest_ = true;
  is_stopping_ = false;
}

void Positioner::advance(double t_s) {
  while (t_ < t_s) {
    while (!waiting_.empty() && waiting_.front().acts_s <= t_) {
      act(waiting_.front());
      waiting_.pop_front();
    }
    double until = t_s;
    if (!waiting_.empty()) until = std::min(until, waiting_.front().acts_s);
    if (!is_at_rest_) {
      const double dt = std::min(step_s_, until - t_);
      step(dt);
      t_ = dt < step_s_ ? until : t_ + dt;
    } else {
      t_ = until;
    }
  }
}

std::vector<double> positioner_response(const PositionerParams& params, double start_rad,
                                        std::span<const PositionCommand> commands, std::span<const double> times_s,
                                        double step_s) {
  std::vector<double> answers(times_s.size(), start_rad);
  if (times_s.empty()) return answers;
  const double first_s = commands.empty() ? times_s.front() : std::min(times_s.front(), commands.front().t_s);
  Positioner axis(params, start_rad, first_s - step_s, step_s);
  for (const PositionCommand& command : commands) axis.go_to(command.t_s, command.target_rad);
  double before_s = axis.time_s(), before_rad = start_rad;
  for (std::size_t i = 0; i < times_s.size();) {
    if (axis.time_s() >= times_s[i]) {
      const double over = axis.time_s() - before_s;
      const double share = over > 0.0 ? (times_s[i] - before_s) / over : 1.0;
      answers[i] = before_rad + share * (axis.output_rad() - before_rad);
      ++i;
      continue;
    }
    before_s = axis.time_s();
    before_rad = axis.output_rad();
    axis.advance(axis.is_at_rest() ? times_s[i] : before_s + step_s);
  }
  return answers;
}

}  // namespace alidade
