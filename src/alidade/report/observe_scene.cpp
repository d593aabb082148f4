#include "alidade/report/observe_scene.h"

#include <fmt/format.h>

#include <cmath>

namespace alidade::report {
namespace {

constexpr double most_points = 1e7;  // beyond that a number is no index

int index_of(double value) { return value >= 0.0 && value < most_points ? static_cast<int>(value) : -1; }

void read_times(const Table& steps, ObserveScene& scene) {
  constexpr double far_s = 1e4;  // a clock's seconds say nothing on an axis
  scene.t_s = steps.numbers("t_s");
  if (scene.t_s.empty() || !std::isfinite(scene.t_s.front())) return;
  const double first = scene.t_s.front();
  scene.is_relative = std::abs(first) > far_s;
  if (!scene.is_relative) return;
  for (double& t : scene.t_s) t -= first;
}

void read_events(const Table& steps, ObserveScene& scene) {
  for (std::size_t i = 0; i < steps.num_rows; ++i) {
    const std::string kind = steps.text("event", i);
    if (!kind.empty() && std::isfinite(scene.t_s[i]))
      scene.events.push_back({scene.t_s[i], kind, index_of(steps.number("event_point", i))});
  }
}

void read_attitudes(const Table& steps, ObserveScene& scene) {
  const auto x = steps.numbers("start_from_cam_qx"), y = steps.numbers("start_from_cam_qy"),
             z = steps.numbers("start_from_cam_qz"), w = steps.numbers("start_from_cam_qw");
  for (std::size_t i = 0; i < steps.num_rows; ++i) {
    const Eigen::Quaterniond q(w[i], x[i], y[i], z[i]);
    if (q.coeffs().allFinite() && q.norm() > 0.5) scene.start_from_cam.emplace_back(i, q.normalized());
  }
}

void read_points(const Table& points, ObserveScene& scene) {
  const auto step = points.numbers("step"), point = points.numbers("point"), u = points.numbers("u_px"),
             v = points.numbers("v_px"), residual_u = points.numbers("residual_u_px"),
             residual_v = points.numbers("residual_v_px"), used = points.numbers("used");
  for (std::size_t i = 0; i < points.num_rows; ++i) {
    const int number = index_of(point[i]);
    if (number < 0) continue;
    scene.points.push_back({index_of(step[i]), number, u[i], v[i], residual_u[i], residual_v[i], used[i] != 0.0});
  }
}

}  // namespace

ObserveScene observe_scene(const Document& document) {
  ObserveScene scene{.document = document,
                     .steps = document.table("steps"),
                     .t_s = {},
                     .intrinsics = {},
                     .events = {},
                     .points = {},
                     .start_from_cam = {}};
  const double width = document.estimated("camera.width"), height = document.estimated("camera.height");
  if (width > 0.0 && height > 0.0 && width < 1e6 && height < 1e6) {
    scene.width_px = width;
    scene.height_px = height;
  }
  if (const Table* points = document.table("points")) read_points(*points, scene);
  if (!scene.steps) return scene;
  read_times(*scene.steps, scene);
  read_events(*scene.steps, scene);
  read_attitudes(*scene.steps, scene);
  for (const char* name : {"fx", "fy", "cx", "cy"}) {
    const std::string column = std::string(name) + "_px";
    scene.intrinsics.push_back({name, scene.steps->numbers(column), scene.steps->numbers("sigma_" + column),
                                scene.steps->numbers("truth_" + column), scene.steps->numbers("bound_" + column)});
  }
  return scene;
}

std::string point_name(int point) { return fmt::format("p{}", point + 1); }

std::string share_text(std::size_t part, std::size_t whole) {
  return whole == 0 ? "–" : fmt::format("{:.1f} %", 100.0 * static_cast<double>(part) / static_cast<double>(whole));
}

}  // namespace alidade::report
