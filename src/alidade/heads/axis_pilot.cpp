#include "alidade/heads/axis_pilot.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace alidade {
namespace {

constexpr double model_step_s = 1e-3, course_step_s = 5e-3, kept_s = 2.0;

/// A value between two places of a course.
template <typename Place, typename Value>
std::optional<double> between(const std::deque<Place>& course, double t_s, const Value& value) {
  if (course.size() < 2 || t_s < course.front().t_s || t_s > course.back().t_s) return std::nullopt;
  const auto after = std::max(std::ranges::lower_bound(course, t_s, {}, &Place::t_s), course.begin() + 1);
  const Place &a = *(after - 1), &b = *after;
  return value(a) + (value(b) - value(a)) * (t_s - a.t_s) / std::max(1e-9, b.t_s - a.t_s);
}

}  // namespace

AxisPilot::AxisPilot(const PositionerParams& axis, double start_rad, double t_s)
    : axis_(axis), model_(axis, start_rad, t_s, model_step_s) {}

void AxisPilot::advance(double t_s) {
  while (model_.time_s() < t_s) {
    model_.advance(std::min(t_s, model_.time_s() + course_step_s));
    course_.push_back({model_.time_s(), model_.output_rad()});
  }
  while (!course_.empty() && course_.front().t_s < t_s - kept_s) course_.pop_front();
}

void AxisPilot::read(double t_s, double angle_rad) {
  advance(t_s);
  readings_.push_back({t_s, angle_rad, angle_rad - model_.output_rad()});
  while (readings_.front().t_s < t_s - kept_s) readings_.pop_front();
}

void AxisPilot::send(double t_s, double target_rad) {
  advance(t_s);
  model_.go_to(t_s, target_rad);
}

std::optional<double> AxisPilot::at(double t_s) const {
  const auto model = between(course_, t_s, [](const Place& place) { return place.model_rad; });
  const auto beside = between(readings_, t_s, [](const Reading& reading) { return reading.beside_rad; });
  if (!model || !beside) return std::nullopt;
  return *model + *beside;
}

/// Where the course will be in the middle of the time for which the command counts, and as far beyond as an axis is
/// behind what it is sent to.
double AxisPilot::simple_command(double acts_s, double period_s, const Course& wanted_rad) const {
  const double middle_s = acts_s + 0.5 * period_s, tau = axis_.time_constant_s, a = axis_.acceleration_rad_s2;
  const double rate =
      (wanted_rad(middle_s + 0.5 * course_step_s) - wanted_rad(middle_s - 0.5 * course_step_s)) / course_step_s;
  const double speed = std::min(std::abs(rate), axis_.rate_rad_s);
  const double lag = speed <= a * tau ? speed * tau : 0.5 * speed * speed / a + 0.5 * a * tau * tau;
  return wanted_rad(middle_s) + std::copysign(lag, rate);
}

double AxisPilot::command(double now_s, double period_s, const Course& wanted_rad) const {
  constexpr double horizon_s = 0.4;
  const double acts_s = now_s + axis_.latency_s, beside = readings_.empty() ? 0.0 : readings_.back().beside_rad;
  Positioner until_then = model_;
  until_then.advance(acts_s);
  const double simple = simple_command(acts_s, period_s, wanted_rad);
  const auto cost = [&](double command) {
    Positioner axis = until_then;
    axis.go_to(acts_s - axis_.latency_s, command);
    double sum2 = 0.0, next_s = acts_s + period_s;
    for (double t_s = acts_s; t_s < acts_s + horizon_s;) {
      if (t_s >= next_s - 1e-9) {
        axis.go_to(t_s - axis_.latency_s, simple_command(t_s, period_s, wanted_rad));
        next_s += period_s;
      }
      axis.advance(t_s += course_step_s);
      const double off = axis.output_rad() + beside - wanted_rad(t_s);
      sum2 += off * off;
    }
    return sum2;
  };
  const double reach = std::max(std::abs(simple - until_then.output_rad() - beside), axis_.rate_rad_s * period_s);
  double best = simple, least = cost(simple);
  for (double step = 0.5 * reach; step > 0.02 * reach; step *= 0.5)
    for (const double sign : {-1.0, 1.0})
      for (double tried = best + sign * step;; tried += sign * step) {
        const double now = cost(tried);
        if (!(now < least) || std::abs(tried - simple) > 3.0 * reach) break;
        least = now;
        best = tried;
      }
  return best;
}

}  // namespace alidade
