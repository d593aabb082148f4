#include "alidade/report/time_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/report/markup.h"
#include "alidade/report/thin.h"

namespace alidade::report {
namespace {

constexpr double unit = 0.8;  // of the paper: a curve has four points a unit at most

double top_of(const Scale& y) { return std::min(y.from, y.to); }
double bottom_of(const Scale& y) { return std::max(y.from, y.to); }

void append_polygon(std::string& d, Place centre, double size, std::initializer_list<Place> corners) {
  std::vector<Place> places;
  for (const Place& corner : corners) places.push_back({centre.x + size * corner.x, centre.y + size * corner.y});
  append_polyline(d, places, true);
}

}  // namespace

std::string time_words(const ObserveScene& scene) {
  return scene.is_relative ? "time since the first row, s" : "time, s";
}

std::string power_text(double value) {
  const double power = std::log10(value);
  if (std::abs(power) < 3.5 || std::abs(power - std::round(power)) > 1e-6) return number_text(value, 2);
  static constexpr std::array<const char*, 10> digits{"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string words = power < 0.0 ? "10⁻" : "10";
  for (const char digit : std::to_string(std::lround(std::abs(power))))
    words += digits[static_cast<std::size_t>(digit - '0')];
  return words;
}

std::string tick_text(double value, double step) {
  if (!(step > 0.0)) return number_text(value, 3);
  const int decimals = std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 9);
  return std::abs(value) < 1e6 ? fmt::format("{:.{}f}", value, decimals) : number_text(value, 4);
}

void append_event_shape(std::string& d, const std::string& kind, Place centre, double size) {
  if (kind == "burst") return append_polygon(d, centre, size, {{-1.0, -0.9}, {1.0, -0.9}, {0.0, 1.0}});
  if (kind == "slip") return append_polygon(d, centre, size, {{0.0, -1.1}, {1.1, 0.0}, {0.0, 1.1}, {-1.1, 0.0}});
  if (kind == "restart") return append_polygon(d, centre, size, {{-0.9, -0.9}, {0.9, -0.9}, {0.9, 0.9}, {-0.9, 0.9}});
  if (kind == "zoom" || kind == "zoom_end")
    return append_polygon(d, centre, size, {{-1.2, -0.4}, {1.2, -0.4}, {1.2, 0.4}, {-1.2, 0.4}});
  if (kind == "gap") {
    append_polygon(d, centre, size, {{-0.8, -1.0}, {-0.2, -1.0}, {-0.2, 1.0}, {-0.8, 1.0}});
    return append_polygon(d, centre, size, {{0.2, -1.0}, {0.8, -1.0}, {0.8, 1.0}, {0.2, 1.0}});
  }
  append_polygon(d, centre, size,
                 {{1, 0}, {0.7, 0.7}, {0, 1}, {-0.7, 0.7}, {-1, 0}, {-0.7, -0.7}, {0, -1}, {0.7, -0.7}});
}

TimePlot::TimePlot(Svg& svg, const ObserveScene& scene, const Scale& y, int wanted_ticks)
    : svg_(svg), scene_(scene), y_(y) {
  const double first = scene.first_s(), last = scene.last_s();
  x_ = {first, last > first ? last : first + 1.0, left, right};
  x_places_ = places(x_, scene.t_s);
  svg_.rect({left, top_of(y_)}, right - left, bottom_of(y_) - top_of(y_), "panel");
  const auto ticks = y_.is_log ? log_ticks(y_.low, y_.high) : linear_ticks(y_.low, y_.high, wanted_ticks);
  const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : 0.0;
  const bool only_powers = y_.is_log && ticks.size() > 5;
  for (const double tick : ticks) {
    const double power = std::log10(tick > 0.0 ? tick : 1.0);
    if (only_powers && std::abs(power - std::round(power)) > 1e-6) continue;
    svg_.line({left, y_(tick)}, {right, y_(tick)}, "gridline");
    svg_.text({left - 5.0, y_(tick) + 4.0}, y_.is_log ? power_text(tick) : tick_text(tick, step), "tick", "end");
  }
}

void TimePlot::begin(const std::string& clip_id) {
  svg_.raw(fmt::format("<clipPath id=\"{}\">", clip_id));
  svg_.rect({left, top_of(y_)}, right - left, bottom_of(y_) - top_of(y_), "");
  svg_.raw(fmt::format("</clipPath><g clip-path=\"url(#{})\">", clip_id));
}

void TimePlot::end() { svg_.raw("</g>"); }

std::vector<double> TimePlot::places(const Scale& scale, const std::vector<double>& values) const {
  std::vector<double> out(values.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    out[i] = std::isfinite(values[i]) ? scale(values[i]) : std::nan("");  // a logarithm of zero lies below
  return out;
}

void TimePlot::time_axis(const std::string& words) {
  const double bottom = bottom_of(y_);
  const auto ticks = linear_ticks(x_.low, x_.high, 6);
  const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : 0.0;
  for (const double tick : ticks) {
    svg_.line({x_(tick), bottom}, {x_(tick), bottom + 3.0}, "axis");
    svg_.text({x_(tick), bottom + 15.0}, tick_text(tick, step), "tick", "middle");
  }
  if (!words.empty()) svg_.text({0.5 * (left + right), bottom + 30.0}, words, "tick", "middle");
}

void TimePlot::zoom_spans() {
  double since = std::nan("");
  const auto shade = [&](double from, double to) {
    svg_.rect({x_(from), top_of(y_)}, std::max(1.5, x_(to) - x_(from)), bottom_of(y_) - top_of(y_), "zoom-span");
  };
  for (const EventMark& event : scene_.events) {
    if (event.kind == "zoom" && !std::isfinite(since)) since = event.t_s;
    if ((event.kind == "zoom_end" || event.kind == "restart") && std::isfinite(since)) {
      shade(since, event.t_s);
      since = std::nan("");
    }
  }
  if (std::isfinite(since)) shade(since, scene_.last_s());
}

void TimePlot::event_marks(bool with_strip) {
  zoom_spans();
  constexpr std::size_t few = 40;
  constexpr double size = 4.0, strip = 7.0;
  std::string shapes, hairlines, last_kind;
  double last_x = -1e9;
  for (const EventMark& event : scene_.events) {
    if (event.kind == "zoom_end") continue;
    const double x = x_(event.t_s);
    if (event.kind == last_kind && x - last_x < 1.5) continue;  // one mark for many at one place
    last_kind = event.kind;
    last_x = x;
    append_event_shape(shapes, event.kind, {x, top_of(y_) - strip}, size);
    if (event.kind != "zoom" && scene_.events.size() <= few)
      append_polyline(hairlines, {{x, top_of(y_)}, {x, bottom_of(y_)}}, false);
  }
  svg_.path(hairlines, "event-line");
  if (with_strip) svg_.path(shapes, "event");
}

void TimePlot::band(const std::vector<double>& low, const std::vector<double>& high, const char* css_class) {
  const std::vector<double> low_places = places(y_, low), high_places = places(y_, high);
  std::vector<double> both(low_places.size());
  for (std::size_t i = 0; i < both.size(); ++i) both[i] = low_places[i] + high_places[i];  // missing where one is
  std::string d;
  for (const auto& piece : thinned_curve({x_places_, both}, 2.0 * unit)) {
    std::vector<Place> outline;
    for (const std::size_t i : piece) outline.push_back({x_places_[i], high_places[i]});
    for (auto it = piece.rbegin(); it != piece.rend(); ++it) outline.push_back({x_places_[*it], low_places[*it]});
    append_polyline(d, outline, true);
  }
  svg_.path(d, css_class);
}

void TimePlot::curve(const std::vector<double>& values, const char* css_class) {
  const std::vector<double> y = places(y_, values);
  std::string d;
  for (const auto& piece : thinned_curve({x_places_, y}, unit)) {
    std::vector<Place> line;
    for (const std::size_t i : piece) {
      const auto same = [&](const Place& place) { return std::abs(place.y - y[i]) < 0.05; };
      if (line.size() > 1 && same(line.back()) && same(line[line.size() - 2])) line.pop_back();  // straight on
      line.push_back({x_places_[i], y[i]});
    }
    if (line.size() == 1) line.push_back({line[0].x + 0.1, line[0].y});
    append_polyline(d, line, false);
  }
  svg_.path(d, css_class);
}

void TimePlot::dots(const std::vector<double>& values, const char* css_class) {
  const std::vector<double> y = places(y_, values);
  std::vector<double> seen_x, seen_y;  // gaps do not matter to dots
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (!std::isfinite(y[i])) continue;
    seen_x.push_back(x_places_[i]);
    seen_y.push_back(y[i]);
  }
  std::string d;
  for (const auto& piece : thinned_curve({seen_x, seen_y}, unit))
    for (const std::size_t i : piece) append_dot(d, {seen_x[i], seen_y[i]});
  svg_.path(d, css_class);
}

void TimePlot::level(double value, const char* css_class) {
  if (std::isfinite(value) && y_.holds(value)) svg_.line({left, y_(value)}, {right, y_(value)}, css_class);
}

}  // namespace alidade::report
