#include "alidade/heads/axis_course.h"

#include <algorithm>

namespace alidade {
namespace {

constexpr double course_step_s = 5e-3, kept_s = 2.0;

/// A value between two points of a course.
template <typename Point, typename Value>
std::optional<double> between(const std::deque<Point>& course, double t_s, const Value& value) {
  if (course.size() < 2 || t_s < course.front().t_s || t_s > course.back().t_s) return std::nullopt;
  const auto after = std::max(std::ranges::lower_bound(course, t_s, {}, &Point::t_s), course.begin() + 1);
  const Point &a = *(after - 1), &b = *after;
  return value(a) + (value(b) - value(a)) * (t_s - a.t_s) / std::max(1e-9, b.t_s - a.t_s);
}

}  // namespace

AxisCourse::AxisCourse(const PositionerParams& axis, double start_rad, double t_s) : model_(axis, start_rad, t_s) {}

void AxisCourse::advance(double t_s) {
  while (model_.time_s() < t_s) {
    model_.advance(std::min(t_s, model_.time_s() + course_step_s));
    course_.push_back({model_.time_s(), model_.output_rad()});
  }
  while (!course_.empty() && course_.front().t_s < t_s - kept_s) course_.pop_front();
}

void AxisCourse::read(double t_s, double angle_rad) {
  advance(t_s);
  readings_.push_back({t_s, angle_rad, angle_rad - model_.output_rad()});
  while (readings_.front().t_s < t_s - kept_s) readings_.pop_front();
}

void AxisCourse::send(double t_s, double target_rad) {
  advance(t_s);
  model_.go_to(t_s, target_rad);
}

std::optional<double> AxisCourse::at(double t_s) const {
  const auto model = between(course_, t_s, [](const Point& point) { return point.model_rad; });
  const auto beside = between(readings_, t_s, [](const Reading& reading) { return reading.beside_rad; });
  if (!model || !beside) return std::nullopt;
  return *model + *beside;
}

}  // namespace alidade
