#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/report/ellipse.h"
#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/scale.h"
#include "alidade/report/svg.h"
#include "alidade/report/time_plot.h"

namespace alidade::report {
namespace {

struct EllipsePanel {
  std::string title, x_name, y_name, unit;
  Eigen::Matrix2d cov;
  double limit;
};

constexpr double side = 196.0, panel_left = 46.0, panel_step = 262.0, panel_top = 26.0;

void draw_panel(Svg& svg, const EllipsePanel& panel, double left) {
  const Scale x{-panel.limit, panel.limit, left, left + side},
      y{-panel.limit, panel.limit, panel_top, panel_top + side};
  svg.text({left, 15.0}, panel.title, "label");
  const std::vector<double> ticks = linear_ticks(-panel.limit, panel.limit, 5);
  const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : 0.0;
  for (const double tick : ticks) {
    svg.line({x(tick), y.from}, {x(tick), y.to}, tick == 0.0 ? "axis" : "gridline");
    svg.line({x.from, y(tick)}, {x.to, y(tick)}, tick == 0.0 ? "axis" : "gridline");
    svg.text({x(tick), y.to + 15.0}, tick_text(tick, step), "tick", "middle");
    svg.text({x.from - 5.0, y(tick) + 4.0}, tick_text(tick, step), "tick", "end");
  }
  const double paper = side / (2.0 * panel.limit);
  std::string d;
  append_ellipse(d, {x(0.0), y(0.0)}, paper * paper * panel.cov, 3.0);
  svg.path(d, "ellipse-fill");
  svg.text({left, y.to + 32.0}, panel.x_name + " to the right, " + panel.y_name + " down, " + panel.unit, "small");
  svg.text({left, y.to + 48.0},
           fmt::format("3σ: {} {}, {} {} {}", panel.x_name, number_text(3.0 * std::sqrt(panel.cov(0, 0)), 2),
                       panel.y_name, number_text(3.0 * std::sqrt(panel.cov(1, 1)), 2), panel.unit),
           "small");
}

/// Round, and so large that 3σ fills most of it.
double limit_for(double sigma) { return 0.5 * round_up_125(2.0 * 1.1 * 3.0 * sigma); }

std::vector<EllipsePanel> ellipse_panels(const BeamMark& beam) {
  const Eigen::Matrix3d origin = 1e6 * beam.cov_origin();
  Eigen::Matrix2d xy, xz;
  xy << origin(0, 0), origin(0, 1), origin(1, 0), origin(1, 1);
  xz << origin(0, 0), origin(0, 2), origin(2, 0), origin(2, 2);
  const Eigen::Matrix2d direction = 1e6 * beam.cov_direction();
  const double mm = limit_for(std::max(larger_sigma(xy), larger_sigma(xz))), mrad = limit_for(larger_sigma(direction));
  // One scale for both of the origin: which coordinate is the weak one shows at a glance.
  return {{"origin, across the view", "x", "y", "mm", xy, mm},
          {"origin, from above", "x", "z", "mm", xz, mm},
          {"direction", "x", "y", "mrad", direction, mrad}};
}

std::string ellipses(const BeamMark& beam) {
  const std::vector<EllipsePanel> panels = ellipse_panels(beam);
  const Eigen::Vector3d origin_mm = 3e3 * beam.cov_origin().diagonal().cwiseMax(0.0).cwiseSqrt();
  Svg svg(panel_left + 2.0 * panel_step + side + 12.0, panel_top + side + 56.0,
          fmt::format("3σ of the origin: x {}, y {}, z {} mm; of the direction up to {} mrad",
                      number_text(origin_mm.x(), 2), number_text(origin_mm.y(), 2), number_text(origin_mm.z(), 2),
                      number_text(3e3 * larger_sigma(beam.cov_direction()), 2)));
  for (std::size_t i = 0; i < panels.size(); ++i)
    draw_panel(svg, panels[i], panel_left + panel_step * static_cast<double>(i));
  return svg.str();
}

std::vector<std::pair<double, double>> predicted_spots(const Document& document) {
  std::vector<std::pair<double, double>> spots;  // range, 3σ
  for (int i = 0; i < 20; ++i) {
    const double at = document.estimated(fmt::format("spot_sigma_at_m[{}]", i)),
                 sigma = document.estimated(fmt::format("spot_sigma_px[{}]", i));
    if (at > 0.0 && sigma > 0.0 && sigma < 1e6) spots.emplace_back(at, 3.0 * sigma);
  }
  return spots;
}

std::string spot_bars(const std::vector<std::pair<double, double>>& spots) {
  constexpr double width = 780.0, left = 100.0, row = 22.0;
  double largest = 0.0;
  for (const auto& spot : spots) largest = std::max(largest, spot.second);
  const Scale x{0.0, largest, left, width - 80.0};
  Svg svg(width, 24.0 + row * static_cast<double>(spots.size()),
          fmt::format("Where the spot will be seen: 3σ up to {} px", number_text(largest, 2)));
  svg.text({8.0, 14.0}, "3σ of where the spot will be seen, for an exact reading, px", "label");
  for (std::size_t i = 0; i < spots.size(); ++i) {
    const double y = 24.0 + row * static_cast<double>(i);
    svg.text({left - 8.0, y + 13.0}, "at " + number_text(spots[i].first, 3) + " m", "tick", "end");
    svg.rect({left, y}, x(spots[i].second) - left, 16.0, "bar-fill");
    svg.text({x(spots[i].second) + 6.0, y + 13.0}, number_text(spots[i].second, 2) + " px", "tick");
  }
  return svg.str();
}

/// σ and its bound against the number of shots, in the unit that is drawn, ×3.
struct CountCurve {
  std::string id, title, unit;
  std::vector<double> num_shots, three_sigma, bound;
};

CountCurve curve_of(const Table& table, const char* name, const char* title, const char* unit,
                    const std::string& column) {
  CountCurve curve{name,
                   title,
                   unit,
                   table.numbers("num_shots"),
                   table.numbers("sigma_" + column),
                   table.numbers("bound_" + column)};
  for (std::vector<double>* values : {&curve.three_sigma, &curve.bound})
    for (double& value : *values) value = value > 0.0 && value < 1e6 ? 3e3 * value : std::nan("");
  for (double& count : curve.num_shots)
    if (!(count >= 1.0 && count < 1e7)) count = std::nan("");
  return curve;
}

std::vector<Place> places_of(const CountCurve& curve, const std::vector<double>& values, const Scale& x,
                             const Scale& y) {
  std::vector<Place> places;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (std::isfinite(values[i]) && std::isfinite(curve.num_shots[i]))
      places.push_back({x(curve.num_shots[i]), y(values[i])});
  return places;
}

std::string count_plot(const CountCurve& curve) {
  constexpr double width = 380.0, left = 52.0, right = width - 12.0, top = 26.0, bottom = 216.0;
  std::vector<double> all = curve.three_sigma;
  all.insert(all.end(), curve.bound.begin(), curve.bound.end());
  const double low_value = quantile(all, 0.0), high_value = quantile(all, 1.0), most = quantile(curve.num_shots, 1.0);
  if (!(low_value > 0.0) || !(most >= 1.0)) return "";
  const Scale y{0.85 * low_value, 1.25 * high_value, bottom, top, true}, x{0.0, 1.04 * most, left, right};
  Svg svg(width, bottom + 40.0,
          fmt::format("{} against the number of shots, with its bound; with all {} shots {} {}", curve.title,
                      number_text(most, 6), number_text(curve.three_sigma.back(), 2), curve.unit));
  svg.text({left, 15.0}, curve.title + ", " + curve.unit, "label");
  double last_y = 1e9;
  std::vector<double> ticks = log_ticks(y.low, y.high);
  if (ticks.size() < 3) ticks = linear_ticks(y.low, y.high, 4);
  for (const double tick : ticks) {
    svg.line({left, y(tick)}, {right, y(tick)}, "gridline");
    if (last_y - y(tick) < 11.0) continue;
    svg.text({left - 6.0, y(tick) + 4.0}, power_text(tick), "tick", "end");
    last_y = y(tick);
  }
  for (const double tick : linear_ticks(0.0, x.high, 6))
    if (std::abs(tick - std::round(tick)) < 1e-6) {
      svg.line({x(tick), bottom}, {x(tick), bottom + 4.0}, "axis");
      svg.text({x(tick), bottom + 17.0}, number_text(tick, 6), "tick", "middle");
    }
  svg.line({left, bottom}, {right, bottom}, "axis");
  svg.text({0.5 * (left + right), bottom + 34.0}, "shots", "tick", "middle");
  // Broad and below: an estimate that is as good as can be lies on its bound.
  const std::vector<Place> bound = places_of(curve, curve.bound, x, y);
  if (bound.size() > 1) svg.polyline(bound, "bound-under");
  const std::vector<Place> sigma = places_of(curve, curve.three_sigma, x, y);
  if (sigma.size() > 1) svg.polyline(sigma, "line-blue");
  for (const Place& place : sigma) svg.circle(place, 3.0, "mark blue");
  return svg.str();
}

std::string count_legend() {
  const auto sample = [](const char* look, const char* words) {
    return fmt::format(
        "<span><svg class=\"sample\" viewBox=\"0 0 26 12\" aria-hidden=\"true\"><path d=\"M1 6L25 6\" "
        "class=\"{}\"/></svg>{}</span>",
        look, words);
  };
  return "<p class=\"legend\">" + sample("line-blue", "3σ, shots in a drawn order") +
         sample("bound-under", "3 × Cramér–Rao bound") + "</p>";
}

}  // namespace

MaybeFigure figure_rangefinder_precision(const RangefinderScene& scene) {
  const auto spots = predicted_spots(scene.document);
  const bool has_ellipses =
      scene.beam && scene.beam->has_cov() && larger_sigma(scene.beam->cov_origin().topLeftCorner<2, 2>()) > 0.0;
  if (!has_ellipses && spots.empty()) return std::nullopt;
  Figure figure{.id = "precision", .title = "How well is it known?", .note = "3σ, mm, mrad, px", .span = 11};
  if (has_ellipses) figure.body += ellipses(*scene.beam);
  if (!spots.empty()) figure.body += spot_bars(spots);
  figure.good = scene.document.is_answer() ? "Good: round and small. A long one shows what the shots leave open."
                                           : "No answer: these shots tell too little to rely on any of this.";
  figure.marks = (has_ellipses ? 3U : 0U) + spots.size();
  return figure;
}

MaybeFigure figure_rangefinder_counts(const RangefinderScene& scene) {
  const Table* table = scene.document.table("by_count");
  if (!table) return std::nullopt;
  const CountCurve origin = curve_of(*table, "origin", "3σ of the origin", "mm", "origin_m"),
                   direction = curve_of(*table, "direction", "3σ of the direction", "mrad", "direction_rad");
  const std::string panels = count_plot(origin) + count_plot(direction);
  if (panels.empty()) return std::nullopt;
  Figure figure{.id = "counts", .title = "Do more shots help?", .note = "mm, mrad", .span = 5};
  figure.body = count_legend() + panels;
  figure.good = "Good: it has flattened, close to its bound; while it still falls steeply, more shots help.";
  figure.marks = static_cast<std::size_t>(
      std::ranges::count_if(origin.three_sigma, [](double value) { return std::isfinite(value); }));
  return figure;
}

}  // namespace alidade::report
