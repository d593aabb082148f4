#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>

#include "alidade/report/colours.h"
#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/picture_map.h"
#include "alidade/report/scale.h"

namespace alidade::report {
namespace {

// Cells stand on a regular grid; their size is the distance of neighbouring centres.
double spacing(const std::vector<double>& centres, double otherwise) {
  std::set<double> distinct;
  for (const double centre : centres)
    if (std::isfinite(centre)) distinct.insert(centre);
  double smallest = otherwise;
  for (auto it = distinct.begin(); it != distinct.end() && std::next(it) != distinct.end(); ++it)
    if (const double gap = *std::next(it) - *it; gap > 1e-3 * otherwise) smallest = std::min(smallest, gap);
  return smallest;
}

struct CellArrows {
  ArrowScale scale;
  int bold = 0, cells = 0;
};

CellArrows draw_cells(Svg& svg, const PicturePanel& panel, const Table& cells) {
  const auto u = cells.numbers("u_px"), v = cells.numbers("v_px"), count = cells.numbers("count"),
             mean_u = cells.numbers("mean_u_px"), mean_v = cells.numbers("mean_v_px"), z = cells.numbers("z");
  const double width = spacing(u, panel.width_px) * panel.scale, height = spacing(v, panel.height_px) * panel.scale;
  CellArrows result{ArrowScale::fitting(panel, quantile(lengths(mean_u, mean_v), 0.9), 0.5 * std::min(width, height))};
  std::string plain, bold;
  for (std::size_t i = 0; i < cells.num_rows; ++i) {
    if (!std::isfinite(u[i]) || !std::isfinite(v[i])) continue;
    const Place centre = panel.at(u[i], v[i]);
    svg.rect({centre.x - 0.5 * width, centre.y - 0.5 * height}, width, height, "cell");
    ++result.cells;
    if (!(count[i] > 0.0)) {
      if (width > 34.0) svg.text({centre.x, centre.y + 4.0}, "none", "small", "middle");
    } else if (std::isfinite(mean_u[i]) && std::isfinite(mean_v[i])) {
      const bool is_bold = z[i] > 3.0;
      result.bold += is_bold ? 1 : 0;
      append_arrow(is_bold ? bold : plain, centre, result.scale.tip(panel, centre, mean_u[i], mean_v[i]), 6.0);
    }
  }
  svg.path(plain, "mean-halo");
  svg.path(plain, "mean");
  svg.path(bold, "mean-halo-bold");
  svg.path(bold, "mean-bold");
  return result;
}

std::string residual_map(const CalibrateScene& scene, std::size_t& marks, CellArrows& arrows) {
  const PicturePanel panel = scene.panel(map_width);
  Svg svg(map_width, panel.height() + 28.0,
          "All residuals in the picture, coloured by direction, with the mean of each cell");
  panel.frame(svg);
  for (int direction = 0; direction < num_directions; ++direction)
    svg.raw(fmt::format("<use href=\"#corners-{}\" class=\"dots d{}\"/>", direction, direction));
  for (const CornerMark& corner : scene.corners)
    marks += corner.is_used && std::isfinite(corner.residual_u_px) && std::isfinite(corner.residual_v_px) ? 1U : 0U;
  const Table* cells = scene.document.table("cells");
  if (!cells) return svg.str();
  arrows = draw_cells(svg, panel, *cells);
  draw_scale_bar(
      svg, {panel.left + 2.0, panel.bottom() + 16.0}, arrows.scale.bar_length(panel),
      number_text(arrows.scale.bar_px, 2) + " px, cell means " + arrows.scale.text() + "; bold: more than 3σ from zero",
      false);
  return svg.str();
}

// The density that the corners' own σ predict: the mean of their normal curves, by classes of σ.
class PredictedDensity {
 public:
  PredictedDensity(const CalibrateScene& scene, double excess_px) {
    for (const CornerMark& corner : scene.corners)
      for (const double own : {corner.sigma_u_px, corner.sigma_v_px})
        if (const double sigma = std::hypot(own, excess_px); corner.is_used && sigma > 1e-5 && sigma < 1e3) {
          ++classes_[static_cast<std::size_t>(std::lround(20.0 * std::log10(sigma / 1e-5)))];
          ++count_;
        }
  }
  [[nodiscard]] bool is_known() const { return count_ > 0; }
  [[nodiscard]] double operator()(double residual_px) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < classes_.size(); ++i) {
      if (classes_[i] == 0) continue;
      const double sigma = 1e-5 * std::pow(10.0, static_cast<double>(i) / 20.0), t = residual_px / sigma;
      sum += classes_[i] * std::exp(-0.5 * t * t) / (sigma * std::sqrt(2.0 * std::numbers::pi));
    }
    return sum / count_;
  }

 private:
  std::array<int, 162> classes_{};
  int count_ = 0;
};

void draw_wheel(Svg& svg, Place centre) {
  constexpr double outer = 27.0, inner = 15.0;
  for (int i = 0; i < num_directions; ++i) {
    const double a = 2.0 * std::numbers::pi * (i - 0.5) / num_directions,
                 b = 2.0 * std::numbers::pi * (i + 0.52) / num_directions;
    std::string d;
    append_polyline(d,
                    {{centre.x + outer * std::cos(a), centre.y + outer * std::sin(a)},
                     {centre.x + outer * std::cos(b), centre.y + outer * std::sin(b)},
                     {centre.x + inner * std::cos(b), centre.y + inner * std::sin(b)},
                     {centre.x + inner * std::cos(a), centre.y + inner * std::sin(a)}},
                    true);
    svg.path(d, "", fmt::format("fill=\"{}\"", hex(direction_colour(i))));
  }
  svg.text({centre.x, centre.y + 4.0}, "dir", "small", "middle");
}

std::string histogram(const CalibrateScene& scene) {
  std::vector<double> residuals;
  for (const CornerMark& corner : scene.corners)
    if (corner.is_used)
      for (const double r : {corner.residual_u_px, corner.residual_v_px})
        if (std::isfinite(r)) residuals.push_back(r);
  if (residuals.size() < 4) return "";
  std::vector<double> sizes = residuals;
  for (double& size : sizes) size = std::abs(size);
  const double limit = round_up_125(1.2 * quantile(sizes, 0.99));
  constexpr int bins = 40;
  std::array<double, bins> counts{};
  for (const double r : residuals) {
    const double place = (r + limit) / (2.0 * limit) * bins;
    if (place >= 0.0 && place < bins) counts[static_cast<std::size_t>(place)] += 1.0;
  }
  const double excess_px = scene.document.estimated("excess_px");
  const PredictedDensity predicted(scene, 0.0), with_excess(scene, excess_px > 0.0 ? excess_px : 0.0);
  const double to_count = static_cast<double>(residuals.size()) * 2.0 * limit / bins;
  double highest = *std::max_element(counts.begin(), counts.end());
  if (predicted.is_known()) highest = std::max(highest, std::min(3.0 * highest, predicted(0.0) * to_count));
  constexpr double left = 20.0, right = 410.0, top = 24.0, bottom = 120.0;
  const Scale x{-limit, limit, left, right}, y{0.0, highest, bottom, top};
  Svg svg(map_width, bottom + 44.0, "Histogram of the residuals against the predicted normal curve");
  svg.text({left, 14.0},
           predicted.is_known() ? "residuals u, v; line: the corners' σ predict; dashed: with the excess"
                                : "residuals u and v",
           "small");
  const double bar = (right - left) / bins;
  for (std::size_t i = 0; i < bins; ++i)
    svg.rect({left + bar * static_cast<double>(i), y(counts[i])}, bar - 1.0, bottom - y(counts[i]), "bar-fill");
  for (const auto& [density, look] : {std::pair{&predicted, "curve"}, std::pair{&with_excess, "curve-dashed"}}) {
    if (!density->is_known() || (density == &with_excess && !(excess_px > 0.0))) continue;
    std::vector<Place> curve;
    for (int i = 0; i <= 200; ++i) {
      const double r = limit * (i / 100.0 - 1.0);
      curve.push_back({x(r), y(std::min(highest, (*density)(r)*to_count))});
    }
    svg.polyline(curve, look);
  }
  svg.line({left, bottom}, {right, bottom}, "axis");
  for (const double tick : linear_ticks(-limit, limit, 5))
    svg.text({x(tick), bottom + 16.0}, number_text(tick, 2), "tick", "middle");
  svg.text({0.5 * (left + right), bottom + 34.0}, "residual, px", "tick", "middle");
  draw_wheel(svg, {466.0, 72.0});
  svg.text({466.0, 118.0}, "direction of", "small", "middle");
  svg.text({466.0, 132.0}, "a residual", "small", "middle");
  return svg.str();
}

}  // namespace

MaybeFigure figure_residuals(const CalibrateScene& scene) {
  if (!scene.has_picture_size() || scene.corners.empty()) return std::nullopt;
  Figure figure{
      .id = "residuals", .title = "Have the residuals structure?", .note = "predicted − found, px", .span = 9};
  CellArrows arrows;
  figure.body = residual_map(scene, figure.marks, arrows);
  if (figure.marks == 0) return std::nullopt;
  figure.body += histogram(scene);
  figure.good = "Good: colours mixed everywhere, no bold arrow, bars under the line.";
  if (arrows.cells > 0) figure.good += fmt::format(" Here {} of {} cells are bold.", arrows.bold, arrows.cells);
  return figure;
}

}  // namespace alidade::report
