#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/scale.h"
#include "alidade/report/svg.h"

namespace alidade::report {
namespace {

constexpr double width = 460.0, left = 58.0, right = width - 12.0;

void draw_y_axis(Svg& svg, const Scale& y, int wanted) {
  for (const double tick : linear_ticks(y.low, y.high, wanted)) {
    svg.line({left, y(tick)}, {right, y(tick)}, tick == 0.0 ? "axis" : "gridline");
    svg.text({left - 6.0, y(tick) + 4.0}, number_text(tick, 2), "tick", "end");
  }
}

void draw_interval(Svg& svg, Place at, double low_y, double high_y, const std::string& colour, bool is_round) {
  svg.line({at.x, low_y}, {at.x, high_y}, "error " + colour);
  for (const double y : {low_y, high_y}) svg.line({at.x - 3.0, y}, {at.x + 3.0, y}, "error " + colour);
  if (is_round)
    svg.circle(at, 4.0, "mark " + colour);
  else
    svg.rect({at.x - 3.5, at.y - 3.5}, 7.0, 7.0, "mark " + colour);
}

int rings_beyond(const Table& rings) {
  int beyond = 0;
  for (std::size_t i = 0; i < rings.num_rows; ++i) {
    const double limit = 3.0 * rings.number("sigma_px", i);
    const double radial = std::abs(rings.number("mean_radial_px", i)),
                 tangential = std::abs(rings.number("mean_tangential_px", i));
    beyond += radial > limit || tangential > limit ? 1 : 0;
  }
  return beyond;
}

std::string ring_plot(const Table& rings) {
  constexpr double top = 30.0, bottom = 210.0;
  double limit = 0.0, farthest = 0.0;
  for (std::size_t i = 0; i < rings.num_rows; ++i) {
    const double sigma = rings.number("sigma_px", i), reach = std::isfinite(sigma) ? 3.0 * sigma : 0.0;
    for (const char* name : {"mean_radial_px", "mean_tangential_px"})
      if (const double mean = rings.number(name, i); std::isfinite(mean))
        limit = std::max(limit, std::abs(mean) + reach);
    if (const double radius = rings.number("radius_px", i); std::isfinite(radius))
      farthest = std::max(farthest, radius);
  }
  if (!(limit > 0.0) || !(farthest > 0.0)) return "";
  limit = round_up_125(limit);
  const Scale x{0.0, 1.05 * farthest, left, right}, y{-limit, limit, bottom, top};
  Svg svg(
      width, bottom + 44.0,
      fmt::format("Mean residual of {} rings around the principal point, radial and tangential; {} of them beyond 3σ",
                  rings.num_rows, rings_beyond(rings)));
  draw_y_axis(svg, y, 4);
  svg.circle({left + 6.0, 10.0}, 4.0, "mark blue");
  svg.text({left + 16.0, 14.0}, "radial", "small");
  svg.rect({left + 76.5, 6.5}, 7.0, 7.0, "mark orange");
  svg.text({left + 90.0, 14.0}, "tangential mean residual ± 3σ, px", "small");
  for (std::size_t i = 0; i < rings.num_rows; ++i) {
    const double radius = rings.number("radius_px", i), sigma = rings.number("sigma_px", i),
                 reach = std::isfinite(sigma) ? 3.0 * sigma : 0.0;
    if (!std::isfinite(radius)) continue;
    for (const auto& [name, colour, shift, is_round] :
         {std::tuple{"mean_radial_px", "blue", -3.5, true}, std::tuple{"mean_tangential_px", "orange", 3.5, false}})
      if (const double mean = rings.number(name, i); std::isfinite(mean))
        draw_interval(svg, {x(radius) + shift, y(mean)}, y(mean - reach), y(mean + reach), colour, is_round);
  }
  for (const double tick : linear_ticks(0.0, x.high, 6))
    svg.text({x(tick), bottom + 16.0}, number_text(tick, 4), "tick", "middle");
  svg.text({0.5 * (left + right), bottom + 36.0}, "distance from the principal point, px", "tick", "middle");
  return svg.str();
}

// Horizontal: names of models are words.
std::string model_plot(const Table& models) {
  double low = 1e300, high = 0.0;
  for (std::size_t i = 0; i < models.num_rows; ++i) {
    const double rms = models.number("heldout_rms_px", i), sigma = models.number("sigma_px", i),
                 reach = std::isfinite(sigma) ? 3.0 * sigma : 0.0;
    if (!std::isfinite(rms)) continue;
    low = std::min(low, std::max(rms - reach, 0.7 * rms));
    high = std::max(high, std::min(rms + reach, 1.5 * rms));
  }
  if (!(high > 0.0)) return "";
  constexpr double names = 150.0;
  const bool is_log = high > 3.0 * low;  // a model that fails by far must not hide the others
  const double margin = is_log ? 0.0 : std::max(0.15 * (high - low), 0.02 * high);
  const Scale x{std::max(1e-6, low - margin), high + margin, names, right, is_log};
  const double bottom = 26.0 + 26.0 * static_cast<double>(models.num_rows);
  Svg svg(width, bottom + 44.0, "Error on photos that were held out, for each lens model");
  svg.text({8.0, 14.0}, "error on held-out photos ± 3σ", "small");
  for (const double tick : is_log ? log_ticks(x.low, x.high) : linear_ticks(x.low, x.high, 4)) {
    svg.line({x(tick), 22.0}, {x(tick), bottom}, "gridline");
    svg.text({x(tick), bottom + 16.0}, number_text(tick, 3), "tick", "middle");
  }
  for (std::size_t i = 0; i < models.num_rows; ++i) {
    const double y = 39.0 + 26.0 * static_cast<double>(i), rms = models.number("heldout_rms_px", i),
                 sigma = models.number("sigma_px", i);
    svg.text({names - 10.0, y + 4.0}, shortened(models.text("name", i), 20), "tick", "end");
    if (!std::isfinite(rms)) continue;
    const double reach = std::isfinite(sigma) ? 3.0 * sigma : 0.0;
    svg.line({std::max(names, x(rms - reach)), y}, {std::min(right, x(rms + reach)), y}, "error blue");
    svg.circle({x(rms), y}, 4.5, "mark blue");
  }
  svg.text({0.5 * (names + right), bottom + 36.0}, "RMS, px", "tick", "middle");
  return svg.str();
}

}  // namespace

MaybeFigure figure_lens(const CalibrateScene& scene) {
  const Table* rings = scene.document.table("rings");
  const Table* models = scene.document.table("models");
  Figure figure{.id = "lens", .title = "Is the lens model enough?", .note = "px", .span = 8};
  if (rings) figure.body += ring_plot(*rings);
  if (models) figure.body += model_plot(*models);
  if (figure.body.empty()) return std::nullopt;
  figure.marks = (rings ? rings->num_rows : 0) + (models ? models->num_rows : 0);
  figure.good = "Good: every interval reaches zero, and no richer model does better on photos it has not seen.";
  if (rings) figure.good += fmt::format(" Here {} of {} rings are beyond 3σ.", rings_beyond(*rings), rings->num_rows);
  return figure;
}

}  // namespace alidade::report
