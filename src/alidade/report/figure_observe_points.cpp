#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/picture_map.h"
#include "alidade/report/scale.h"
#include "alidade/report/thin.h"

namespace alidade::report {
namespace {

constexpr double width = 460.0;         // of the tracks
constexpr double narrow_width = 360.0;  // of two drawings side by side

bool has_residual(const PointMark& mark) {
  return std::isfinite(mark.residual_u_px) && std::isfinite(mark.residual_v_px);
}
bool has_pixel(const PointMark& mark) { return std::isfinite(mark.u_px) && std::isfinite(mark.v_px); }
double size_of(const PointMark& mark) { return std::hypot(mark.residual_u_px, mark.residual_v_px); }

struct PointSummary {
  int point = 0;
  double rms_px = 0.0, quantile_px = 0.0;  ///< Of the residual's length; below the second lie 95 %.
  std::size_t used = 0, left_out = 0;
};

/// Worst first.
std::vector<PointSummary> summaries(const ObserveScene& scene) {
  std::map<int, std::vector<double>> sizes;
  std::map<int, std::size_t> left_out;
  for (const PointMark& mark : scene.points) {
    if (!has_residual(mark)) continue;
    std::vector<double>& of_point = sizes[mark.point];
    if (mark.is_used)
      of_point.push_back(size_of(mark));
    else
      ++left_out[mark.point];
  }
  std::vector<PointSummary> out;
  for (const auto& [point, list] : sizes) {
    double sum = 0.0;
    for (const double size : list) sum += size * size;
    const double rms = list.empty() ? std::nan("") : std::sqrt(sum / static_cast<double>(list.size()));
    out.push_back({point, rms, quantile(list, 0.95), list.size(), left_out[point]});
  }
  std::ranges::stable_sort(out, [](const PointSummary& a, const PointSummary& b) {
    return (std::isfinite(a.rms_px) ? a.rms_px : -1.0) > (std::isfinite(b.rms_px) ? b.rms_px : -1.0);
  });
  return out;
}

/// σ of a coordinate: stated, or that of the residuals.
double noise_of(const ObserveScene& scene) {
  if (const double noise = scene.document.estimated("sigma_px"); noise > 0.0) return noise;
  std::vector<double> sizes;
  for (const PointMark& mark : scene.points)
    if (mark.is_used && has_residual(mark)) sizes.push_back(size_of(mark));
  return quantile(sizes, 0.5) / 1.1774;  // √(2 ln 2): median of a normal vector's length
}

void draw_scatter_axes(Svg& svg, const Scale& x, const Scale& y) {
  for (const double tick : linear_ticks(x.low, x.high, 4)) {
    svg.line({x(tick), y.from}, {x(tick), y.to}, tick == 0.0 ? "axis" : "gridline");
    svg.line({x.from, y(tick)}, {x.to, y(tick)}, tick == 0.0 ? "axis" : "gridline");
    svg.text({x(tick), y.to + 15.0}, number_text(tick, 2), "tick", "middle");
    svg.text({x.from - 5.0, y(tick) + 4.0}, number_text(tick, 2), "tick", "end");
  }
  svg.text({0.5 * (x.from + x.to), y.to + 31.0}, "residual u, px", "tick", "middle");
  svg.text({x.from, y.from - 8.0}, "residual v, px, downwards", "tick");
}

struct ScatterMarks {
  std::string used, left_out;  ///< Paths.
  std::size_t beyond = 0;      ///< Outside the panel.
  std::size_t every = 1;       ///< So many of the used are one dot.
};

ScatterMarks scatter_marks(const ObserveScene& scene, const Scale& x, const Scale& y) {
  constexpr std::size_t most = 4000, most_characters = 60'000;
  ScatterMarks marks;
  marks.every = scene.points.size() / most + 1;
  for (std::size_t i = 0; i < scene.points.size(); ++i) {
    const PointMark& mark = scene.points[i];
    if (!has_residual(mark)) continue;
    const Place at{x(mark.residual_u_px), y(mark.residual_v_px)};
    if (!x.holds(mark.residual_u_px) || !y.holds(mark.residual_v_px))
      ++marks.beyond;
    else if (mark.is_used && i % marks.every == 0)
      append_dot(marks.used, at);
    else if (!mark.is_used && marks.left_out.size() < most_characters)
      append_polyline(marks.left_out, {{at.x - 3.0, at.y - 3.0}, {at.x + 3.0, at.y + 3.0}}, false);
  }
  return marks;
}

std::vector<std::string> scatter_words(const ScatterMarks& marks) {
  std::vector<std::string> words{"circle: 3σ"};
  if (marks.every > 1) words.push_back(fmt::format("one dot of {}", marks.every));
  if (!marks.left_out.empty()) words.emplace_back("stroke: left out");
  if (marks.beyond > 0) words.push_back(fmt::format("{} outside", marks.beyond));
  return words;
}

std::string scatter(const ObserveScene& scene, double noise_px) {
  constexpr double left = 44.0, top = 28.0, side = narrow_width - left - 14.0;
  std::vector<double> sizes;
  for (const PointMark& mark : scene.points)
    if (has_residual(mark) && mark.is_used) sizes.push_back(size_of(mark));
  const double limit = round_up_125(std::max(4.0 * (noise_px > 0.0 ? noise_px : 0.0), quantile(sizes, 0.999)));
  const Scale x{-limit, limit, left, left + side}, y{-limit, limit, top, top + side};  // v points down
  Svg svg(narrow_width, top + side + 38.0,
          fmt::format("Residuals of {} pixels about zero; σ of a coordinate is {} px", sizes.size(),
                      number_text(noise_px, 2)));
  svg.rect({left, top}, side, side, "panel");
  draw_scatter_axes(svg, x, y);
  const ScatterMarks marks = scatter_marks(scene, x, y);
  svg.path(marks.used, "residual-dots");
  svg.path(marks.left_out, "left-out-mark");
  const double radius = 3.0 * noise_px * side / (2.0 * limit);
  if (radius > 0.0 && radius < side) svg.circle({x(0.0), y(0.0)}, radius, "ring");
  double line = top + 14.0;
  for (const std::string& words : scatter_words(marks)) {
    svg.text({left + side - 6.0, line}, words, "small", "end");
    line += 16.0;
  }
  return svg.str();
}

std::string point_bars(const std::vector<PointSummary>& points) {
  constexpr std::size_t most = 20;
  constexpr double left = 40.0, pitch = 15.0, top = 24.0, right = narrow_width - 84.0;
  const std::size_t shown = std::min(most, points.size());
  double high = 0.0;
  for (std::size_t i = 0; i < shown; ++i)
    if (std::isfinite(points[i].quantile_px)) high = std::max({high, points[i].quantile_px, points[i].rms_px});
  if (!(high > 0.0)) return "";
  const Scale x{0.0, 1.05 * high, left, right};
  const double bottom = top + pitch * static_cast<double>(shown);
  Svg svg(narrow_width, bottom + 38.0,
          fmt::format("RMS residual of {} points, worst first: {} with {} px", points.size(),
                      point_name(points[0].point), number_text(points[0].rms_px, 2)));
  svg.text({left, 14.0},
           fmt::format("by point, worst first{}: bar RMS, tick 95 %",
                       shown < points.size() ? fmt::format(" ({} of {})", shown, points.size()) : std::string()),
           "small");
  for (const double tick : linear_ticks(0.0, x.high, 5)) {
    svg.line({x(tick), top}, {x(tick), bottom}, "gridline");
    svg.text({x(tick), bottom + 15.0}, number_text(tick, 2), "tick", "middle");
  }
  for (std::size_t i = 0; i < shown; ++i) {
    const double y = top + pitch * static_cast<double>(i);
    const PointSummary& point = points[i];
    svg.text({left - 6.0, y + 12.0}, point_name(point.point), "tick", "end");
    if (std::isfinite(point.rms_px)) {
      svg.rect({left, y + 3.0}, x(point.rms_px) - left, pitch - 6.0, "bar-fill");
      svg.line({x(point.quantile_px), y + 2.0}, {x(point.quantile_px), y + pitch - 2.0}, "bar");
    }
    svg.text({right + 10.0, y + 12.0},
             point.left_out > 0 ? fmt::format("{} left out", point.left_out) : fmt::format("{} pixels", point.used),
             "tick");
  }
  svg.text({0.5 * (left + right), bottom + 31.0}, "residual, px", "tick", "middle");
  return svg.str();
}

/// The picture's size, or what the pixels take up.
PicturePanel track_panel(const ObserveScene& scene, double& u0, double& v0) {
  constexpr double most_high = 460.0;
  u0 = v0 = 0.0;
  if (scene.has_picture_size()) return PicturePanel::fitting(scene.width_px, scene.height_px, width, most_high);
  std::vector<double> u, v;
  for (const PointMark& mark : scene.points)
    if (has_pixel(mark)) {
      u.push_back(mark.u_px);
      v.push_back(mark.v_px);
    }
  const double margin = 0.05 * (quantile(u, 1.0) - quantile(u, 0.0) + 20.0);
  u0 = quantile(u, 0.0) - margin;
  v0 = quantile(v, 0.0) - margin;
  return PicturePanel::fitting(std::min(1e6, quantile(u, 1.0) + margin - u0),
                               std::min(1e6, quantile(v, 1.0) + margin - v0), width, most_high);
}

using Track = std::vector<const PointMark*>;

/// Pixels of each point in order of time, the longest tracks first.
std::vector<Track> tracks_of(const ObserveScene& scene) {
  std::map<int, Track> by_point;
  for (const PointMark& mark : scene.points)
    if (has_pixel(mark)) by_point[mark.point].push_back(&mark);
  std::vector<Track> tracks;
  for (auto& [point, track] : by_point) {
    std::ranges::stable_sort(track, {}, &PointMark::step);
    tracks.push_back(std::move(track));
  }
  std::ranges::stable_sort(tracks, [](const Track& a, const Track& b) { return a.size() > b.size(); });
  return tracks;
}

/// Steps between neighbours of a track, most often.
double usual_gap(const Track& track) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < track.size(); ++i) gaps.push_back(track[i]->step - track[i - 1]->step);
  return gaps.empty() ? 1.0 : std::max(1.0, quantile(gaps, 0.5));
}

struct TrackPaths {
  std::string lines, dots;
};

/// A line, broken where the point was out of sight; dots where so few rows are known that a line would lie.
void append_track(TrackPaths& paths, const Track& track, const PicturePanel& panel, Place origin, std::size_t every) {
  constexpr double widest_gap = 4.0;
  const double gap = usual_gap(track);
  std::vector<Place> line;
  for (std::size_t i = 0; i < track.size(); ++i) {
    const Place at = panel.at(track[i]->u_px - origin.x, track[i]->v_px - origin.y);
    if (gap > widest_gap) {
      if (i % every == 0) append_dot(paths.dots, at);
      continue;
    }
    if (i > 0 && track[i]->step - track[i - 1]->step > 4.0 * gap) {
      append_polyline(paths.lines, line, false);
      line.clear();
    }
    if (line.empty() || i % every == 0 || i + 1 == track.size()) line.push_back(at);
  }
  append_polyline(paths.lines, line, false);
}

void draw_principal_point(Svg& svg, const ObserveScene& scene, const PicturePanel& panel, double u0, double v0) {
  const double cx = scene.document.estimated("camera.cx"), cy = scene.document.estimated("camera.cy");
  if (!std::isfinite(cx) || !std::isfinite(cy) || std::abs(cx) > 1e6 || std::abs(cy) > 1e6) return;
  const Place at = panel.at(cx - u0, cy - v0);
  svg.line({at.x - 8.0, at.y}, {at.x + 8.0, at.y}, "centre-mark");
  svg.line({at.x, at.y - 8.0}, {at.x, at.y + 8.0}, "centre-mark");
  svg.text({at.x + 10.0, at.y - 6.0}, "cx, cy", "small");
}

std::string track_plot(const ObserveScene& scene, const std::vector<Track>& tracks) {
  constexpr std::size_t most_tracks = 300, most_places = 6000;
  double u0 = 0.0, v0 = 0.0;
  const PicturePanel panel = track_panel(scene, u0, v0);
  const std::size_t shown = std::min(most_tracks, tracks.size());
  std::size_t places = 0;
  for (std::size_t i = 0; i < shown; ++i) places += tracks[i].size();
  const std::size_t every = places / most_places + 1;
  Svg svg(width, panel.bottom() + 24.0, fmt::format("Tracks of {} points over the picture", tracks.size()));
  panel.frame(svg);
  TrackPaths paths;
  std::string starts;
  for (std::size_t i = 0; i < shown; ++i) {
    append_track(paths, tracks[i], panel, {u0, v0}, every);
    append_dot(starts, panel.at(tracks[i].front()->u_px - u0, tracks[i].front()->v_px - v0));
  }
  svg.path(paths.lines, "track");
  svg.path(paths.dots, "nis-dots");
  svg.path(starts, "track-start");
  if (tracks.size() <= 24)
    for (const Track& track : tracks) {
      const Place at = panel.at(track.front()->u_px - u0, track.front()->v_px - v0);
      svg.text({at.x + 6.0, at.y - 6.0}, point_name(track.front()->point), "small");
    }
  draw_principal_point(svg, scene, panel, u0, v0);
  svg.text({0.0, panel.bottom() + 16.0},
           fmt::format("{}{}dots: where each was first seen",
                       scene.has_picture_size() ? "frame: the picture; " : "frame: what the pixels take up; ",
                       shown < tracks.size() ? fmt::format("the {} longest of {} tracks; ", shown, tracks.size()) : ""),
           "small");
  return svg.str();
}

}  // namespace

MaybeFigure figure_observe_points(const ObserveScene& scene) {
  const std::vector<PointSummary> points = summaries(scene);
  if (points.empty()) return std::nullopt;
  Figure figure{.id = "points", .title = "Does each point fit?", .note = "predicted − seen, px", .span = 12};
  for (const PointSummary& point : points) figure.marks += point.used + point.left_out;
  figure.body = "<div class=\"panels\">" + scatter(scene, noise_of(scene)) + point_bars(points) + "</div>";
  figure.good =
      "Good: a round cloud inside the circle, all points alike. A point that stands out moves by itself, or "
      "its tracker slips.";
  return figure;
}

MaybeFigure figure_observe_tracks(const ObserveScene& scene) {
  const std::vector<Track> tracks = tracks_of(scene);
  if (tracks.empty()) return std::nullopt;
  Figure figure{.id = "tracks", .title = "Where were the points seen?", .note = "picture", .span = 8};
  for (const Track& track : tracks) figure.marks += track.size();
  figure.body = track_plot(scene, tracks);
  figure.good = "Good: points all over the picture, not in one line, moving both across and up and down.";
  return figure;
}

}  // namespace alidade::report
