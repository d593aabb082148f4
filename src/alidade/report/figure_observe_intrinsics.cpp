#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/time_plot.h"

namespace alidade::report {
namespace {

struct Range {
  double low = 0.0, high = 0.0;
  [[nodiscard]] bool is_there() const { return high >= low && std::isfinite(low) && std::isfinite(high); }
};

std::vector<double> combined(const std::vector<double>& a, double factor, const std::vector<double>& b) {
  std::vector<double> out(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) out[i] = a[i] + factor * b[i];
  return out;
}

/// The rows that tell the scale: with an estimate, but not those of the first search.
std::vector<bool> settled_rows(const ObserveScene& scene, const IntrinsicColumns& column) {
  double first = std::nan("");
  for (std::size_t i = 0; i < column.value.size(); ++i)
    if (std::isfinite(column.value[i]) && std::isfinite(scene.t_s[i])) {
      first = scene.t_s[i];
      break;
    }
  const double from = first + 0.12 * (scene.last_s() - first);
  std::vector<bool> settled(column.value.size());
  bool has_some = false;
  for (std::size_t i = 0; i < settled.size(); ++i) {
    settled[i] = scene.t_s[i] >= from;
    has_some |= settled[i] && std::isfinite(column.value[i]);
  }
  return has_some ? settled : std::vector<bool>(settled.size(), true);
}

/// From low to high of what has settled, its truth included; what the search did before may lie outside.
Range value_range(const ObserveScene& scene, const IntrinsicColumns& column) {
  const std::vector<bool> settled = settled_rows(scene, column);
  std::vector<double> values, reaches;
  for (std::size_t i = 0; i < settled.size(); ++i) {
    if (!settled[i] || !std::isfinite(column.value[i])) continue;
    const double reach = std::isfinite(column.sigma[i]) ? 3.0 * column.sigma[i] : 0.0;
    reaches.push_back(reach);
    values.push_back(column.value[i]);
    if (std::isfinite(column.truth[i])) values.push_back(column.truth[i]);
  }
  if (values.empty()) return {1.0, 0.0};
  const double reach = quantile(reaches, 0.8);
  const double low = quantile(values, 0.002) - reach, high = quantile(values, 0.998) + reach;
  const double margin = std::max(0.12 * (high - low), 1e-4 * std::max(1.0, std::abs(high)));
  return {low - margin, high + margin};
}

/// Of 3σ, bound and error: a range of decades that holds nearly all of them.
Range error_range(const IntrinsicColumns& column) {
  std::vector<double> sizes;
  for (std::size_t i = 0; i < column.value.size(); ++i)
    for (const double size :
         {3.0 * column.sigma[i], 3.0 * column.bound[i], std::abs(column.value[i] - column.truth[i])})
      if (std::isfinite(size) && size > 0.0) sizes.push_back(size);
  if (sizes.empty()) return {1.0, 0.0};
  const double low = quantile(sizes, 0.02), high = quantile(sizes, 0.995);
  return {round_down_125(0.7 * low), round_up_125(1.3 * std::max(high, 3.0 * low))};
}

/// |estimate − truth|, and how many of them are within 3σ.
struct Errors {
  std::vector<double> size;
  std::size_t known = 0, inside = 0;
};

Errors errors_of(const IntrinsicColumns& column) {
  Errors errors{combined(column.value, -1.0, column.truth)};
  for (std::size_t i = 0; i < errors.size.size(); ++i) {
    errors.size[i] = std::abs(errors.size[i]);
    if (!std::isfinite(errors.size[i]) || !std::isfinite(column.sigma[i])) continue;
    ++errors.known;
    errors.inside += errors.size[i] <= 3.0 * column.sigma[i] ? 1U : 0U;
  }
  return errors;
}

std::string last_words(const IntrinsicColumns& column) {
  for (std::size_t i = column.value.size(); i-- > 0;)
    if (std::isfinite(column.value[i])) {
      const ValueText words = value_text(column.value[i], column.sigma[i]);
      return words.value + (words.plus_minus.empty() ? "" : " ± " + words.plus_minus) + " px";
    }
  return "none";
}

std::string panel(const ObserveScene& scene, const IntrinsicColumns& column) {
  const Range range = value_range(scene, column), error = error_range(column);
  if (!range.is_there()) return "";
  constexpr double top = 34.0, bottom = 172.0, error_top = 184.0, error_bottom = 262.0;
  const Errors errors = errors_of(column);
  const bool has_error = error.is_there();
  const double low_end = has_error ? error_bottom : bottom;
  // A run that was refused has no last value to quote.
  const std::string last = scene.document.is_answer() ? "at the end " + last_words(column) : std::string();
  Svg svg(TimePlot::width, low_end + 36.0, fmt::format("{} over time {}", column.name, last));
  svg.text({TimePlot::left, 15.0}, column.name + ", px", "label");
  svg.text({TimePlot::right, 15.0}, last, "small", "end");
  TimePlot value(svg, scene, {range.low, range.high, bottom, top}, 4);
  value.event_marks(true);
  value.begin("clip-" + column.name);
  value.band(combined(column.value, -3.0, column.sigma), combined(column.value, 3.0, column.sigma), "band");
  value.curve(column.value, "line-blue");
  value.curve(column.truth, "truth");
  value.end();
  if (!has_error) {
    value.time_axis(time_words(scene));
    return svg.str();
  }
  TimePlot size(svg, scene, {error.low, error.high, error_bottom, error_top, true}, 3);
  size.event_marks(false);
  size.begin("clip-error-" + column.name);
  size.curve(errors.size, "line-error");
  size.curve(combined(std::vector<double>(column.sigma.size(), 0.0), 3.0, column.sigma), "line-blue");
  size.curve(combined(std::vector<double>(column.bound.size(), 0.0), 3.0, column.bound), "bound");
  size.end();
  size.time_axis(time_words(scene));
  return svg.str();
}

std::string sample(const char* css_class, const std::string& words) {
  return fmt::format(
      "<span><svg class=\"sample\" viewBox=\"0 0 26 12\" aria-hidden=\"true\"><path d=\"M1 6L25 6\" "
      "class=\"{}\"/></svg>{}</span>",
      css_class, escaped(words));
}

std::string event_words(const std::string& kind) {
  static const std::map<std::string, const char*> words{{"start", "first estimate"},
                                                        {"burst", "a frame left out: noise burst"},
                                                        {"slip", "a point left out: slipped"},
                                                        {"zoom", "zoom begins"},
                                                        {"zoom_end", "zoom ends"},
                                                        {"restart", "estimated anew"},
                                                        {"gap", "gap: rotation not known across it"}};
  const auto found = words.find(kind);
  return found == words.end() ? kind : found->second;
}

bool has_any(const ObserveScene& scene, const std::vector<double> IntrinsicColumns::*member) {
  return std::ranges::any_of(scene.intrinsics, [&](const IntrinsicColumns& column) {
    return std::ranges::any_of(column.*member, [](double value) { return std::isfinite(value); });
  });
}

std::string legend(const ObserveScene& scene) {
  std::string out = "<p class=\"legend\">" + sample("line-blue", "estimate");
  if (has_any(scene, &IntrinsicColumns::sigma))
    out +=
        "<span><svg class=\"sample\" viewBox=\"0 0 26 12\" aria-hidden=\"true\"><path d=\"M1 1L25 1L25 11L1 11Z\" "
        "class=\"band\"/></svg>± 3σ; below: 3σ by itself</span>";
  if (has_any(scene, &IntrinsicColumns::truth))
    out += sample("truth", "truth") + sample("line-error", "below: |estimate − truth|");
  if (has_any(scene, &IntrinsicColumns::bound)) out += sample("bound", "below: 3 × Cramér–Rao bound");
  std::map<std::string, std::size_t> kinds;
  for (const EventMark& event : scene.events)
    if (event.kind != "zoom_end") ++kinds[event.kind];
  for (const auto& [kind, count] : kinds) {
    std::string d;
    append_event_shape(d, kind, {6.0, 6.0}, 4.0);
    out += fmt::format(
        "<span><svg class=\"sample-mark\" viewBox=\"0 0 12 12\" aria-hidden=\"true\"><path d=\"{}\" "
        "class=\"event\"/></svg>{}{}</span>",
        d, escaped(kind == "zoom" ? "zoom, shaded" : event_words(kind)), count > 1 ? fmt::format(" ({}×)", count) : "");
  }
  return out + "</p>";
}

std::string event_list(const ObserveScene& scene) {
  if (scene.events.empty()) return "";
  constexpr std::size_t most = 200;
  std::string items;
  for (std::size_t i = 0; i < std::min(most, scene.events.size()); ++i) {
    const EventMark& event = scene.events[i];
    items += fmt::format("<li><b>{:.3f} s</b> {}{}</li>", event.t_s, escaped(event_words(event.kind)),
                         event.point >= 0 ? " (" + point_name(event.point) + ")" : "");
  }
  if (scene.events.size() > most)
    items += fmt::format("<li>… and {} more: intrinsics.csv has them all</li>", scene.events.size() - most);
  return fmt::format("<details class=\"reasons\"><summary>{} event{}</summary><ul>{}</ul></details>",
                     scene.events.size(), scene.events.size() == 1 ? "" : "s", items);
}

}  // namespace

MaybeFigure figure_observe_intrinsics(const ObserveScene& scene) {
  Figure figure{
      .id = "intrinsics", .title = "What are fx, fy, cx and cy, and how sure is it?", .note = "px, ± 3σ", .span = 18};
  std::string panels;
  std::size_t known = 0, inside = 0;
  for (const IntrinsicColumns& column : scene.intrinsics) {
    panels += panel(scene, column);
    const Errors errors = errors_of(column);
    known += errors.known;
    inside += errors.inside;
    figure.marks = std::max(figure.marks, static_cast<std::size_t>(std::ranges::count_if(
                                              column.value, [](double value) { return std::isfinite(value); })));
  }
  if (panels.empty()) return std::nullopt;
  figure.body = legend(scene) + "<div class=\"panels\">" + panels + "</div>" + event_list(scene);
  figure.good = "Good: the band narrows and stays level; it widens while the lens zooms, and is narrow again after.";
  if (known > 0)
    figure.good +=
        fmt::format(" The truth is inside 3σ for {} of all values (99.7 % expected).", share_text(inside, known));
  return figure;
}

}  // namespace alidade::report
