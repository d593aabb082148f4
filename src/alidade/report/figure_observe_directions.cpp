#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>

#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/scale.h"
#include "alidade/report/view3.h"

namespace alidade::report {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr double degrees = 180.0 / std::numbers::pi;

/// Degrees to the right and up of where the camera looked at the start.
struct Angles {
  double right = 0.0, up = 0.0;
};

Angles angles_of(const Eigen::Vector3d& direction) {
  return {degrees * std::atan2(direction.x(), direction.z()),
          degrees * std::atan2(-direction.y(), std::hypot(direction.x(), direction.z()))};
}

Eigen::Vector3d direction_of(double right, double up) {
  const double a = right / degrees, b = up / degrees;
  return {std::sin(a) * std::cos(b), -std::sin(b), std::cos(a) * std::cos(b)};
}

struct Looks {
  Points axis;                     ///< Where the camera looked, step by step (thinned), in the start's frame.
  std::vector<Points> footprints;  ///< Outlines of the picture: first, last and outermost.
  Points bearings;                 ///< Points.
  std::size_t num_steps = 0;
};

/// Edges of the picture, eight pieces a side, on the unit sphere of the camera.
Points outline_in_cam(const ObserveScene& scene) {
  const double fx = scene.document.estimated("camera.fx"), fy = scene.document.estimated("camera.fy"),
               cx = scene.document.estimated("camera.cx"), cy = scene.document.estimated("camera.cy");
  Points outline;
  if (!scene.has_picture_size() || !(fx > 0.0) || !(fy > 0.0) || !std::isfinite(cx) || !std::isfinite(cy))
    return outline;
  constexpr int pieces = 8;
  const double w = scene.width_px, h = scene.height_px;
  const std::array<Place, 5> corners{
      {{-0.5, -0.5}, {w - 0.5, -0.5}, {w - 0.5, h - 0.5}, {-0.5, h - 0.5}, {-0.5, -0.5}}};
  for (std::size_t side = 0; side < 4; ++side)
    for (int i = 0; i < pieces; ++i) {
      const double share = static_cast<double>(i) / pieces;
      const double u = corners[side].x + share * (corners[side + 1].x - corners[side].x),
                   v = corners[side].y + share * (corners[side + 1].y - corners[side].y);
      outline.push_back(Eigen::Vector3d((u - cx) / fx, (v - cy) / fy, 1.0).normalized());
    }
  return outline;
}

/// First and last step and those that look furthest right, left, up and down.
std::set<std::size_t> outermost(const std::vector<Angles>& angles) {
  std::set<std::size_t> chosen;
  if (angles.empty()) return chosen;
  const auto by_right = [](const Angles& a, const Angles& b) { return a.right < b.right; };
  const auto by_up = [](const Angles& a, const Angles& b) { return a.up < b.up; };
  const auto place = [&](auto it) { return static_cast<std::size_t>(it - angles.begin()); };
  const auto [left, right] = std::minmax_element(angles.begin(), angles.end(), by_right);
  const auto [low, high] = std::minmax_element(angles.begin(), angles.end(), by_up);
  return {0, angles.size() - 1, place(left), place(right), place(low), place(high)};
}

Looks looks_of(const ObserveScene& scene) {
  constexpr std::size_t most = 1500;  // places of a line
  Looks looks;
  looks.num_steps = scene.start_from_cam.size();
  std::vector<Angles> angles;
  const std::size_t every = looks.num_steps / most + 1;
  for (std::size_t i = 0; i < looks.num_steps; ++i) {
    const Eigen::Vector3d axis = scene.start_from_cam[i].second * Eigen::Vector3d::UnitZ();
    angles.push_back(angles_of(axis));
    if (i % every == 0 || i + 1 == looks.num_steps) looks.axis.push_back(axis);
  }
  const Points outline = outline_in_cam(scene);
  if (!outline.empty())
    for (const std::size_t step : outermost(angles)) {
      looks.footprints.emplace_back();
      for (const Eigen::Vector3d& ray : outline)
        looks.footprints.back().push_back(scene.start_from_cam[step].second * ray);
    }
  if (const Table* bearings = scene.document.table("bearings"))
    for (std::size_t i = 0; i < std::min<std::size_t>(bearings->num_rows, 2000); ++i) {
      const Eigen::Vector3d ray(bearings->number("x", i), bearings->number("y", i), bearings->number("z", i));
      if (ray.allFinite() && ray.norm() > 1e-9) looks.bearings.push_back(ray.normalized());
    }
  return looks;
}

/// As seen from behind the camera and a little above, turned so that what it looked at lies in the middle.
View3 view_of(const Looks& looks) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& axis : looks.axis) mean += axis;
  if (!(mean.norm() > 1e-6)) mean = Eigen::Vector3d::UnitZ();
  const Angles middle = angles_of(mean);
  const Eigen::Vector3d onward = direction_of(middle.right - 24.0, std::clamp(middle.up - 20.0, -70.0, 70.0));
  View3 view;
  view.right_in_cam = Eigen::Vector3d::UnitY().cross(onward).normalized();
  view.down_in_cam = onward.cross(view.right_in_cam);
  return view;
}

/// Appends those pieces of a line on the sphere that lie behind its middle (or before it).
void append_half(std::string& d, const View3& view, const Points& line, bool is_far, bool closed) {
  std::vector<Place> piece;
  const std::size_t count = line.size() + (closed && !line.empty() ? 1 : 0);
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d& point = line[i % line.size()];
    if ((view.depth(point) >= 0.0) == is_far) {
      piece.push_back(view.at(point));
      continue;
    }
    if (piece.size() > 1) append_polyline(d, piece, false);
    piece.clear();
  }
  if (piece.size() > 1) append_polyline(d, piece, false);
}

void append_graticule(std::string& d, const View3& view, bool is_far) {
  for (int right = -180; right < 180; right += 30) {
    Points meridian;
    for (int up = -90; up <= 90; up += 6) meridian.push_back(direction_of(right, up));
    append_half(d, view, meridian, is_far, false);
  }
  for (int up = -60; up <= 60; up += 30) {
    Points parallel;
    for (int right = -180; right <= 180; right += 6) parallel.push_back(direction_of(right, up));
    append_half(d, view, parallel, is_far, false);
  }
}

std::string sphere(const Looks& looks) {
  constexpr double width = 360.0, radius = 160.0, height = 2.0 * radius + 8.0;
  View3 view = view_of(looks);
  view.scale = radius;
  view.x0 = 0.5 * width;
  view.y0 = 0.5 * height;
  Svg svg(width, height, "Directions that the camera looked in, on a sphere around it, seen from behind it");
  svg.circle({view.x0, view.y0}, radius, "sphere");
  std::string far, near, front, axis, dots;
  append_graticule(far, view, true);
  append_graticule(near, view, false);
  svg.path(far, "gridline");
  for (const Points& footprint : looks.footprints) append_half(front, view, footprint, true, true);
  svg.path(front, "footprint");
  for (const Eigen::Vector3d& ray : looks.bearings)
    if (view.depth(ray) >= 0.0) append_dot(dots, view.at(ray));
  svg.path(dots, "bearing-dots");
  append_half(axis, view, looks.axis, true, false);
  svg.path(axis, "line-blue");
  axis.clear();
  append_half(axis, view, looks.axis, false, false);
  svg.path(axis, "line-near");
  svg.path(near, "near-line");
  const Place centre = view.at(Eigen::Vector3d::Zero());
  for (const auto& [direction, name] : {std::pair{Eigen::Vector3d(Eigen::Vector3d::UnitX()), "x"},
                                        std::pair{Eigen::Vector3d(Eigen::Vector3d::UnitY()), "y"},
                                        std::pair{Eigen::Vector3d(Eigen::Vector3d::UnitZ()), "z"}}) {
    const Place tip = view.at(0.3 * direction), beyond = view.at(0.38 * direction);
    svg.line(centre, tip, std::string("axis-") + name);
    svg.text({beyond.x, beyond.y + 4.0}, name, std::string("axis-name-") + name, "middle");
  }
  return svg.str();
}

/// Angles of a line, without the jump from +180° to −180°.
std::vector<Angles> unwrapped(const Points& line, double near_right) {
  std::vector<Angles> out;
  double last = near_right;
  for (const Eigen::Vector3d& direction : line) {
    Angles angles = angles_of(direction);
    angles.right += 360.0 * std::round((last - angles.right) / 360.0);
    last = angles.right;
    out.push_back(angles);
  }
  return out;
}

/// All that the chart shows, in degrees.
struct Chart {
  std::vector<Angles> axis, bearings;
  std::vector<std::vector<Angles>> outlines;
  Scale x, y;  ///< Alike in both directions.
  double across = 0.0, up_and_down = 0.0;
};

constexpr double chart_width = 360.0;

Chart chart_of(const Looks& looks) {
  constexpr double left = 36.0, top = 8.0, most_high = 284.0;
  Chart chart;
  std::vector<double> right, up;
  const auto note = [&](const std::vector<Angles>& line) {
    for (const Angles& angles : line) {
      right.push_back(angles.right);
      up.push_back(angles.up);
    }
  };
  note(chart.axis = unwrapped(looks.axis, 0.0));
  chart.across = quantile(right, 1.0) - quantile(right, 0.0);
  chart.up_and_down = quantile(up, 1.0) - quantile(up, 0.0);
  const double middle = quantile(right, 0.5);
  for (const Points& footprint : looks.footprints) note(chart.outlines.emplace_back(unwrapped(footprint, middle)));
  note(chart.bearings = unwrapped(looks.bearings, middle));
  const double low_r = quantile(right, 0.0) - 1.0, high_r = quantile(right, 1.0) + 1.0, low_u = quantile(up, 0.0) - 1.0,
               high_u = quantile(up, 1.0) + 1.0;
  const double scale = std::min((chart_width - left - 10.0) / (high_r - low_r), most_high / (high_u - low_u));
  chart.x = {low_r, high_r, left, left + scale * (high_r - low_r)};
  chart.y = {low_u, high_u, top + scale * (high_u - low_u), top};
  return chart;
}

void draw_chart_axes(Svg& svg, const Scale& x, const Scale& y) {
  svg.rect({x.from, y.to}, x.to - x.from, y.from - y.to, "panel");
  for (const double tick : linear_ticks(x.low, x.high, 6)) {
    svg.line({x(tick), y.to}, {x(tick), y.from}, "gridline");
    svg.text({x(tick), y.from + 15.0}, number_text(tick, 4), "tick", "middle");
  }
  for (const double tick : linear_ticks(y.low, y.high, 5)) {
    svg.line({x.from, y(tick)}, {x.to, y(tick)}, "gridline");
    svg.text({x.from - 5.0, y(tick) + 4.0}, number_text(tick, 4), "tick", "end");
  }
  svg.text({x.from, y.from + 31.0}, "° right of the first view; upwards: ° up", "tick");
}

std::string chart_plot(const Looks& looks) {
  const Chart chart = chart_of(looks);
  Svg svg(chart_width, chart.y.from + 38.0,
          fmt::format("The same in degrees: the view moved {}° across and {}° up and down",
                      number_text(chart.across, 3), number_text(chart.up_and_down, 3)));
  draw_chart_axes(svg, chart.x, chart.y);
  const auto draw = [&](const std::vector<Angles>& line, const char* look, bool closed) {
    std::vector<Place> places;
    for (const Angles& angles : line) places.push_back({chart.x(angles.right), chart.y(angles.up)});
    std::string d;
    append_polyline(d, places, closed);
    svg.path(d, look);
  };
  for (const auto& outline : chart.outlines) draw(outline, "footprint", true);
  std::string dots;
  for (const Angles& angles : chart.bearings) append_dot(dots, {chart.x(angles.right), chart.y(angles.up)});
  svg.path(dots, "bearing-dots");
  draw(chart.axis, "line-blue", false);
  return svg.str();
}

}  // namespace

MaybeFigure figure_observe_directions(const ObserveScene& scene) {
  const Looks looks = looks_of(scene);
  if (looks.axis.size() < 2) return std::nullopt;
  Figure figure{.id = "directions",
                .title = "Where did it look?",
                .note = std::string("line: the optical axis") +
                        (looks.footprints.empty() ? "" : "; frames: the picture") +
                        (looks.bearings.empty() ? "" : "; dots: points"),
                .span = 12};
  figure.marks = looks.num_steps;
  figure.body = "<div class=\"panels\">" + sphere(looks) + chart_plot(looks) + "</div>";
  figure.good = "Good: it went across and up and down; a level or an upright line alone leaves a parameter open.";
  return figure;
}

}  // namespace alidade::report
