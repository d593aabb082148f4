#include "alidade/report/picture_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "alidade/report/colours.h"
#include "alidade/report/contour.h"
#include "alidade/report/indexed_png.h"
#include "alidade/report/markup.h"
#include "alidade/report/scale.h"

namespace alidade::report {
namespace {

constexpr int num_shades = 250;

const std::vector<Rgb>& pixel_palette() {
  static const std::vector<Rgb> palette = [] {
    std::vector<Rgb> colours;
    for (int i = 0; i < num_shades; ++i) colours.push_back(cividis(i / (num_shades - 1.0)));
    return colours;
  }();
  return palette;
}

std::uint8_t shade(double size_px) {
  if (!std::isfinite(size_px)) return transparent_index;
  return static_cast<std::uint8_t>(std::lround(std::clamp(PixelColours::share(size_px), 0.0, 1.0) * (num_shades - 1)));
}

// 1, 2, 5, 10 …; where these are too few for a reader, more of each decade.
std::vector<double> contour_levels(double low, double high) {
  std::vector<double> levels = log_ticks(low, high);
  if (levels.size() >= 3) return levels;
  levels.clear();
  const double power = std::pow(10.0, std::floor(std::log10(low)));
  for (const double decade : {power, 10.0 * power})
    for (const double factor : {1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0})
      if (decade * factor > low && decade * factor < high) levels.push_back(decade * factor);
  while (levels.size() > 7)
    for (std::size_t i = 1; i < levels.size(); ++i) levels.erase(levels.begin() + static_cast<std::ptrdiff_t>(i));
  return levels;
}

Place place_of(const PicturePanel& panel, const Grid& grid, GridPoint point) {
  return panel.at(grid.u0_px + point.col * grid.du_px, grid.v0_px + point.row * grid.dv_px);
}

// The place on the line that keeps furthest from the other labels, but off the rim.
bool place_label(const PicturePanel& panel, const std::vector<Place>& line, std::vector<Place>& taken, Place& chosen) {
  constexpr double rim_x = 30.0, rim_y = 12.0, apart = 55.0;
  double best = apart;
  bool found = false;
  const std::size_t step = std::max<std::size_t>(1, line.size() / 40);
  for (std::size_t i = 0; i < line.size(); i += step) {
    const Place at = line[i];
    if (at.x < panel.left + rim_x || at.x > panel.left + panel.width() - rim_x) continue;
    if (at.y < panel.top + rim_y || at.y > panel.bottom() - rim_y) continue;
    double nearest = 90.0;  // further apart than this is no better
    for (const Place& other : taken) nearest = std::min(nearest, std::hypot(at.x - other.x, 2.0 * (at.y - other.y)));
    if (nearest > best) {
      best = nearest;
      chosen = at;
      found = true;
    }
  }
  if (found) taken.push_back(chosen);
  return found;
}

}  // namespace

PicturePanel PicturePanel::fitting(double width_px, double height_px, double width, double max_height) {
  PicturePanel panel{.width_px = width_px, .height_px = height_px};
  panel.scale = std::min(width / width_px, max_height / height_px);
  panel.left = 0.5 * (width - panel.width());
  return panel;
}

void draw_heat(Svg& svg, const PicturePanel& panel, const Grid& grid, const std::vector<double>& sizes_px,
               const std::string& clip_id) {
  std::vector<std::uint8_t> indices(sizes_px.size());
  std::transform(sizes_px.begin(), sizes_px.end(), indices.begin(), shade);
  const std::string uri =
      "data:image/png;base64," + base64(indexed_png(grid.cols, grid.rows, indices, pixel_palette()));
  svg.raw(fmt::format("<clipPath id=\"{}\">", clip_id));
  svg.rect({panel.left, panel.top}, panel.width(), panel.height(), "");
  svg.raw("</clipPath>");
  const Place corner = panel.at(grid.u0_px - 0.5 * grid.du_px, grid.v0_px - 0.5 * grid.dv_px);
  svg.raw(fmt::format("<g clip-path=\"url(#{})\">", clip_id));
  svg.image(corner, grid.cols * grid.du_px * panel.scale, grid.rows * grid.dv_px * panel.scale, uri);
  svg.raw("</g>");
}

int draw_contours(Svg& svg, const PicturePanel& panel, const Grid& grid, const std::vector<double>& sizes_px,
                  double smallest_share) {
  std::vector<double> logs;
  for (const double size : sizes_px) logs.push_back(size > 0.0 ? std::log(size) : std::nan(""));
  double low = quantile(sizes_px, 0.0), high = quantile(sizes_px, 1.0);
  if (!(high > 0.0)) return 0;
  low = std::max(low, smallest_share * high);
  std::vector<Place> taken, marks;
  std::vector<std::string> words;
  const std::vector<double> levels = contour_levels(low, high);
  std::string d;
  for (const double level : levels) {
    std::vector<std::vector<Place>> lines;
    for (const Contour& contour : trace_contours(grid.cols, grid.rows, logs, std::log(level))) {
      if (contour.points.size() < 3) continue;
      std::vector<Place> line;
      for (const GridPoint& point : contour.points) line.push_back(place_of(panel, grid, point));
      append_polyline(d, line, contour.is_closed());
      lines.push_back(std::move(line));
    }
    const auto longest =
        std::max_element(lines.begin(), lines.end(), [](const auto& a, const auto& b) { return a.size() < b.size(); });
    Place at;
    if (longest == lines.end() || !place_label(panel, *longest, taken, at)) continue;
    marks.push_back(at);
    words.push_back(number_text(level, 2) + " px");
  }
  svg.path(d, "contour");
  for (std::size_t i = 0; i < marks.size(); ++i) svg.badge(marks[i], words[i]);
  return static_cast<int>(levels.size());
}

ArrowScale ArrowScale::fitting(const PicturePanel& panel, double typical_px, double length) {
  ArrowScale arrows;
  if (!(typical_px > 0.0)) typical_px = 1.0;
  arrows.magnification = std::clamp(round_down_125(length / (typical_px * panel.scale)), 1.0, 1e5);
  arrows.bar_px = round_down_125(80.0 / (arrows.magnification * panel.scale));
  return arrows;
}

std::string ArrowScale::text() const { return fmt::format("×{:.0f}", magnification); }

void draw_scale_bar(Svg& svg, Place left_middle, double length, const std::string& words, bool on_picture) {
  if (on_picture)
    svg.rect({left_middle.x - 7.0, left_middle.y - 12.0}, length + text_width(words, 12.0) + 21.0, 24.0, "badge",
             "rx=\"3\"");
  const char* look = on_picture ? "bar-light" : "bar";
  svg.line(left_middle, {left_middle.x + length, left_middle.y}, look);
  for (const double x : {left_middle.x, left_middle.x + length})
    svg.line({x, left_middle.y - 4.0}, {x, left_middle.y + 4.0}, look);
  svg.text({left_middle.x + length + 7.0, left_middle.y + 4.0}, words, on_picture ? "badge-text" : "small");
}

int draw_field(Svg& svg, const PicturePanel& panel, const Grid& grid, const std::string& u_name,
               const std::string& v_name, const ArrowScale& scale, int across, const std::string& clip_id) {
  const std::vector<double> u = grid.value(u_name), v = grid.value(v_name);
  if (u.empty() || v.empty()) return 0;
  const int step = std::max(1, static_cast<int>(std::lround(static_cast<double>(grid.cols) / across)));
  const double longest = 2.0 * step * std::min(grid.du_px, grid.dv_px) * panel.scale;  // beyond it they cross
  std::string d;
  int count = 0;
  for (int row = step / 2; row < grid.rows; row += step)
    for (int col = step / 2; col < grid.cols; col += step) {
      const auto at = static_cast<std::size_t>(row * grid.cols + col);
      if (!std::isfinite(u[at]) || !std::isfinite(v[at])) continue;
      const Place from = panel.at(grid.u0_px + col * grid.du_px, grid.v0_px + row * grid.dv_px);
      const Place tip = scale.tip(panel, from, u[at], v[at]);
      if (std::hypot(tip.x - from.x, tip.y - from.y) > longest) continue;
      append_arrow(d, from, tip, 5.0);
      ++count;
    }
  const std::string clip = fmt::format("clip-path=\"url(#{})\"", clip_id);
  svg.path(d, "halo", clip);
  svg.path(d, "vector", clip);
  return count;
}

void draw_pixel_colour_bar(Svg& svg, double left, double right, double top, const std::string& words) {
  std::vector<std::uint8_t> ramp;
  for (int i = 0; i < num_shades; ++i) ramp.push_back(static_cast<std::uint8_t>(i));
  svg.image({left, top}, right - left, 9.0,
            "data:image/png;base64," + base64(indexed_png(num_shades, 1, ramp, pixel_palette())));
  const Scale x{PixelColours::low_px, PixelColours::high_px, left, right, true};
  for (const double tick : log_ticks(x.low, x.high)) {
    svg.line({x(tick), top + 9.0}, {x(tick), top + 13.0}, "axis");
    svg.text({x(tick), top + 25.0}, number_text(tick, 2), "tick", "middle");
  }
  svg.text({0.5 * (left + right), top + 40.0}, words, "tick", "middle");
}

std::vector<double> lengths(const std::vector<double>& u, const std::vector<double>& v) {
  std::vector<double> sizes;
  for (std::size_t i = 0; i < std::min(u.size(), v.size()); ++i) sizes.push_back(std::hypot(u[i], v[i]));
  return sizes;
}

std::vector<double> times(double factor, std::vector<double> values) {
  for (double& value : values) value *= factor;
  return values;
}

}  // namespace alidade::report
