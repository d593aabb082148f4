#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "alidade/observe/hybrid.h"
#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/time_plot.h"

namespace alidade::report {
namespace {

constexpr std::array<const char*, 3> looks{"series-x", "series-y", "series-z"};

/// Up to three columns that are drawn together.
struct Series {
  std::string title, unit;
  std::vector<std::string> names;
  std::vector<std::vector<double>> values;
};

bool has_numbers(const std::vector<double>& values) {
  return std::ranges::any_of(values, [](double value) { return std::isfinite(value); });
}

Series motion_of(const Table& steps) {
  constexpr double degrees = 180.0 / std::numbers::pi;
  const auto columns = [&](const std::array<std::pair<const char*, const char*>, 3>& wanted, Series series) {
    for (const auto& [column, name] : wanted) {
      std::vector<double> values = steps.numbers(column);
      if (!has_numbers(values)) continue;
      for (double& value : values) value *= degrees;
      series.names.emplace_back(name);
      series.values.push_back(std::move(values));
    }
    return series;
  };
  const Series angles =
      columns({{{"pan_rad", "pan"}, {"tilt_rad", "tilt"}, {"roll_rad", "roll"}}}, {"how the head stood", "°", {}, {}});
  if (!angles.names.empty()) return angles;
  return columns({{{"omega_x_rad_per_s", "ω x"}, {"omega_y_rad_per_s", "ω y"}, {"omega_z_rad_per_s", "ω z"}}},
                 {"how fast it turned", "°/s", {}, {}});
}

std::string motion_plot(const ObserveScene& scene, const Series& series) {
  double size = 0.0;
  for (const auto& values : series.values) size = std::max(size, largest_size(values));
  double low = 1e300, high = -1e300;
  for (const auto& values : series.values)
    for (const double value : values)
      if (std::isfinite(value)) {
        low = std::min(low, value);
        high = std::max(high, value);
      }
  const double margin = std::max(0.08 * (high - low), 1e-3 * std::max(size, 1e-3));
  constexpr double top = 40.0, bottom = 160.0;
  Svg svg(TimePlot::width, bottom + 36.0, fmt::format("{} over time, {}", series.title, series.unit));
  svg.text({TimePlot::left, 15.0}, series.title + ", " + series.unit, "label");
  double x = TimePlot::right;
  for (std::size_t i = series.names.size(); i-- > 0;) {
    x -= text_width(series.names[i], 11.5);
    svg.text({x, 15.0}, series.names[i], "small");
    svg.line({x - 30.0, 11.0}, {x - 6.0, 11.0}, looks[i]);
    x -= 40.0;
  }
  TimePlot plot(svg, scene, {low - margin, high + margin, bottom, top}, 4);
  plot.event_marks(true);
  plot.begin("clip-motion");
  for (std::size_t i = 0; i < series.values.size(); ++i) plot.curve(series.values[i], looks[i]);
  plot.end();
  plot.time_axis(time_words(scene));
  return svg.str();
}

double last_finite(const std::vector<double>& values) {
  for (std::size_t i = values.size(); i-- > 0;)
    if (std::isfinite(values[i])) return values[i];
  return std::nan("");
}

std::string last_combination(const Table& steps) {
  for (std::size_t i = steps.num_rows; i-- > 0;)
    if (const std::string words = steps.text("weak_combination", i); !words.empty()) return words;
  return "";
}

struct Weakness {
  std::vector<double> information;
  double limit = 0.0, care = 0.0;  ///< NaN if there is none.
  std::string combination;
};

std::string weak_plot(const ObserveScene& scene, const Weakness& weak) {
  std::vector<double> positive;
  for (const double value : weak.information)
    if (value > 0.0 && std::isfinite(value)) positive.push_back(value);
  for (const double limit : {weak.limit, weak.care})
    if (limit > 0.0) positive.push_back(limit);
  const double high = 2.0 * quantile(positive, 1.0), lowest = 0.4 * quantile(positive, 0.0),
               low = std::max(lowest, 0.02 * (weak.limit > 0.0 ? weak.limit : 1e-4 * high));
  constexpr double top = 24.0, bottom = 160.0;
  Svg svg(TimePlot::width, bottom + 36.0,
          fmt::format("Information on the weakest combination {} over time, at the end {}", weak.combination,
                      number_text(last_finite(weak.information), 2)));
  svg.text({TimePlot::left, 15.0},
           "information on the weakest combination" + (weak.combination.empty() ? "" : ", " + weak.combination),
           "label");
  const Scale y{low, high, bottom, top, true};
  TimePlot plot(svg, scene, y, 4);
  if (weak.limit > 0.0)
    svg.rect({TimePlot::left, y(weak.limit)}, TimePlot::right - TimePlot::left, bottom - y(weak.limit), "below-limit");
  plot.event_marks(false);
  plot.begin("clip-weak");
  plot.curve(weak.information, "curve");
  plot.end();
  plot.level(weak.care, "care-line");
  plot.level(weak.limit, "limit-line");
  if (weak.care > 0.0 && y.holds(weak.care))
    svg.text({TimePlot::right - 6.0, y(weak.care) - 4.0}, "with care below", "small", "end");
  if (weak.limit > 0.0 && y.holds(weak.limit))
    svg.text({TimePlot::right - 6.0, y(weak.limit) + 13.0}, "below: cannot be told", "small", "end");
  plot.time_axis(time_words(scene));
  return svg.str();
}

/// NIS over its degrees of freedom with the bounds that 95 % keep, step by step. Counted are steps without an event.
struct Consistency {
  std::vector<double> ratio, low, high, mean;
  std::size_t known = 0, inside = 0;
};

/// Mean over about 40 stretches of time, held within each.
void add_means(const ObserveScene& scene, Consistency& nis) {
  constexpr int stretches = 40;
  const double width = (scene.last_s() - scene.first_s()) / stretches;
  if (!(width > 0.0)) return;
  for (std::size_t begin = 0; begin < nis.ratio.size();) {
    const double slot = std::floor((scene.t_s[begin] - scene.first_s()) / width);
    double sum = 0.0, count = 0.0;
    std::size_t end = begin;
    for (; end < nis.ratio.size() && (end == begin || std::floor((scene.t_s[end] - scene.first_s()) / width) == slot);
         ++end)
      if (std::isfinite(nis.ratio[end])) {
        sum += nis.ratio[end];
        count += 1.0;
      }
    for (std::size_t i = begin; i < end && count > 0.0; ++i) nis.mean[i] = sum / count;
    begin = end;
  }
}

Consistency consistency_of(const ObserveScene& scene) {
  constexpr double z95 = 1.959964;
  const std::vector<double> nis = scene.steps->numbers("nis"), dof = scene.steps->numbers("nis_dof");
  const std::vector<double> none(nis.size(), std::nan(""));
  Consistency out{none, none, none, none};
  for (std::size_t i = 0; i < nis.size(); ++i) {
    if (!std::isfinite(nis[i]) || !(dof[i] >= 1.0 && dof[i] < 1e8)) continue;
    const int n = static_cast<int>(dof[i]);
    out.ratio[i] = nis[i] / dof[i];
    out.low[i] = chi2_quantile(n, -z95) / dof[i];
    out.high[i] = chi2_quantile(n, z95) / dof[i];
    if (!scene.steps->text("event", i).empty()) continue;  // of a thinned table all of these are kept
    ++out.known;
    out.inside += out.low[i] <= out.ratio[i] && out.ratio[i] <= out.high[i] ? 1U : 0U;
  }
  add_means(scene, out);
  return out;
}

std::string nis_plot(const ObserveScene& scene, const Consistency& nis) {
  const double low = std::max(1e-3, std::min(0.4, 0.8 * quantile(nis.ratio, 0.002))),
               high = std::max({3.0, 1.3 * quantile(nis.high, 1.0), 1.3 * quantile(nis.ratio, 1.0)});
  constexpr double top = 34.0, bottom = 300.0;
  Svg svg(TimePlot::width, bottom + 36.0,
          fmt::format("Normalised innovation squared of {} frames; {} of them inside the 95 % bounds", nis.known,
                      share_text(nis.inside, nis.known)));
  svg.text({TimePlot::left, 15.0}, "NIS over its degrees of freedom: 1 is expected", "label");
  TimePlot plot(svg, scene, {round_down_125(low), round_up_125(high), bottom, top, true}, 4);
  plot.event_marks(true);
  plot.begin("clip-nis");
  plot.band(nis.low, nis.high, "band");
  plot.dots(nis.ratio, "nis-dots");
  plot.curve(nis.mean, "line-orange");
  plot.end();
  plot.level(1.0, "dashed");
  plot.time_axis(time_words(scene));
  return svg.str();
}

}  // namespace

MaybeFigure figure_observe_motion(const ObserveScene& scene) {
  if (!scene.steps) return std::nullopt;
  const Series motion = motion_of(*scene.steps);
  const Weakness weak{scene.steps->numbers("weak_eigenvalue"), last_finite(scene.steps->numbers("weak_limit")),
                      last_finite(scene.steps->numbers("weak_care")), last_combination(*scene.steps)};
  const bool has_weak =
      std::ranges::any_of(weak.information, [](double value) { return std::isfinite(value) && value > 0.0; });
  if (motion.names.empty() && !has_weak) return std::nullopt;
  Figure figure{.id = "motion", .title = "Did the motion tell enough?", .note = "x: tilting, y: panning", .span = 8};
  figure.marks = scene.steps->num_rows;
  if (!motion.names.empty()) figure.body += motion_plot(scene, motion);
  if (has_weak) figure.body += weak_plot(scene, weak);
  figure.good = "Good: it turns about two axes, again and again, and the information rises above its limit early.";
  if (has_weak && weak.limit > 0.0)
    figure.good += fmt::format(" At the end it is {} times the limit.",
                               number_text(last_finite(weak.information) / weak.limit, 2));
  return figure;
}

MaybeFigure figure_observe_nis(const ObserveScene& scene) {
  if (!scene.steps) return std::nullopt;
  const Consistency nis = consistency_of(scene);
  if (nis.known == 0) return std::nullopt;
  Figure figure{.id = "nis", .title = "Does each frame fit?", .note = "band: 95 % of frames; orange: mean", .span = 8};
  figure.marks = nis.known;
  figure.body = nis_plot(scene, nis);
  figure.good = fmt::format(
      "Good: dots in the band, the mean near 1; above: noisier than stated, or the model lacks something. Here {} are "
      "inside (95 % expected).",
      share_text(nis.inside, nis.known));
  return figure;
}

}  // namespace alidade::report
