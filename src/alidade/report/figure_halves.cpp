#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/report/colours.h"
#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/picture_map.h"
#include "alidade/report/scale.h"

namespace alidade::report {
namespace {

constexpr double narrow_width = 460.0;

// Size in colour with contours; with arrows over it if names are given.
struct Field {
  std::string title, id, u_name, v_name;
  std::vector<double> sizes_px;
};

std::string field_map(const Field& field, const Grid& grid, PicturePanel panel, double width, int& arrows) {
  panel.top = 22.0;
  const std::string label = fmt::format("{}: at most {} px", field.title, number_text(largest_size(field.sizes_px), 2));
  const bool has_arrows = !field.u_name.empty();
  Svg svg(width, panel.bottom() + (has_arrows ? 30.0 : 4.0), label);
  svg.text({panel.left, 14.0}, field.title, "small");
  panel.frame(svg);
  draw_heat(svg, panel, grid, field.sizes_px, "clip-" + field.id);
  if (has_arrows) {
    const ArrowScale scale = ArrowScale::fitting(panel, quantile(field.sizes_px, 0.75), 0.07 * width);
    arrows = draw_field(svg, panel, grid, field.u_name, field.v_name, scale, 11, "clip-" + field.id);
    draw_scale_bar(svg, {panel.left + 2.0, panel.bottom() + 17.0}, scale.bar_length(panel),
                   number_text(scale.bar_px, 2) + " px, arrows " + scale.text() + "; far longer ones left out", false);
  }
  draw_contours(svg, panel, grid, field.sizes_px,
                has_arrows ? 0.03 : 1e-3);  // near the zero of a difference they tell nothing
  return svg.str();
}

std::string colour_key(double width) {
  Svg svg(width, 46.0, "Colours of sizes in px", "key");
  draw_pixel_colour_bar(svg, 20.0, width - 20.0, 2.0, "px");
  return svg.str();
}

// Counting only: the share of the grid where the first is not above the second.
double share_not_above(const std::vector<double>& a, const std::vector<double>& b) {
  std::size_t known = 0, below = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    if (!std::isfinite(a[i]) || !std::isfinite(b[i])) continue;
    ++known;
    below += a[i] <= b[i] ? 1U : 0U;
  }
  return known > 0 ? static_cast<double>(below) / static_cast<double>(known) : std::nan("");
}

std::string percent(double share) { return std::isfinite(share) ? fmt::format("{:.0f} %", 100.0 * share) : "–"; }

// Of a document without a picture size, the grid itself tells the extent.
PicturePanel panel_of(const Document& document, const Grid& grid, double width) {
  double width_px = document.estimated("camera.width"), height_px = document.estimated("camera.height");
  if (!(width_px >= 1.0) || !(height_px >= 1.0)) {
    width_px = grid.u0_px + grid.du_px * (grid.cols - 1) + 1.0;
    height_px = grid.v0_px + grid.dv_px * (grid.rows - 1) + 1.0;
  }
  return PicturePanel::fitting(std::max(1.0, width_px), std::max(1.0, height_px), width, width);
}

struct DiagonalCurves {
  std::vector<double> along_px, size, three_sigma_a, three_sigma_b;
};

// The grid's values nearest to the diagonal from top left to bottom right.
DiagonalCurves diagonal_curves(const Grid& grid) {
  const auto size = lengths(grid.value("delta_u_px"), grid.value("delta_v_px"));
  const auto a = grid.value("sigma_a_px"), b = grid.value("sigma_b_px");
  DiagonalCurves curves;
  const int steps = std::max(grid.cols, grid.rows);
  for (int i = 0; i < steps; ++i) {
    const double share = i / (steps - 1.0);
    const auto col = std::lround(share * (grid.cols - 1)), row = std::lround(share * (grid.rows - 1));
    const auto at = static_cast<std::size_t>(row * grid.cols + col);
    const auto value = [at](const std::vector<double>& values) {
      return at < values.size() ? values[at] : std::nan("");
    };
    curves.along_px.push_back(std::hypot(static_cast<double>(col) * grid.du_px, static_cast<double>(row) * grid.dv_px));
    curves.size.push_back(value(size));
    curves.three_sigma_a.push_back(3.0 * value(a));
    curves.three_sigma_b.push_back(3.0 * value(b));
  }
  return curves;
}

void draw_curve(Svg& svg, const Scale& x, const Scale& y, const std::vector<double>& xs, const std::vector<double>& ys,
                const char* look) {
  std::vector<Place> line;
  for (std::size_t i = 0; i < ys.size(); ++i)
    if (std::isfinite(ys[i])) line.push_back({x(xs[i]), std::min(y(ys[i]), y.from)});
  if (line.size() > 1) svg.polyline(line, look);
}

}  // namespace

MaybeFigure figure_halves(const CalibrateScene& scene) {
  const Grid* grid = scene.document.grid("halves");
  if (!grid) return std::nullopt;
  const std::vector<double> size = lengths(grid->value("delta_u_px"), grid->value("delta_v_px"));
  const std::vector<double> predicted = times(3.0, grid->value("predicted_sigma_px"));
  if (!(largest_size(size) > 0.0)) return std::nullopt;
  Figure figure{.id = "halves",
                .title = "Do the halves agree?",
                .note = "two cameras, each from half of the photos, px",
                .span = 16};
  const PicturePanel panel = panel_of(scene.document, *grid, narrow_width);
  int arrows = 0;
  figure.body = "<div class=\"pair\"><figure>" +
                field_map({"difference of the halves", "halves", "delta_u_px", "delta_v_px", size}, *grid, panel,
                          narrow_width, arrows) +
                "</figure>";
  figure.marks = static_cast<std::size_t>(arrows);
  if (largest_size(predicted) > 0.0) {
    int none = 0;
    figure.body += "<figure>" +
                   field_map({"3σ that the noise predicts for it", "halves-sigma", "", "", predicted}, *grid, panel,
                             narrow_width, none) +
                   "</figure>";
    figure.good = "Good: the difference stays below the predicted 3σ. Here it does in " +
                  percent(share_not_above(size, predicted)) + " of the picture.";
  }
  figure.body += "</div>" + colour_key(map_width);
  return figure;
}

MaybeFigure figure_difference(const Document& document) {
  const Grid* grid = document.grid("diff");
  if (!grid) return std::nullopt;
  const std::vector<double> size = lengths(grid->value("delta_u_px"), grid->value("delta_v_px"));
  if (size.empty() || !std::isfinite(quantile(size, 0.5))) return std::nullopt;
  Figure figure{.id = "diff", .title = "How far apart?", .note = "after the best rigid motion, px", .span = 14};
  constexpr double width = 760.0, half = 372.0;
  int arrows = 0, none = 0;
  figure.body = field_map({"from A to B", "diff", "delta_u_px", "delta_v_px", size}, *grid,
                          panel_of(document, *grid, width), width, arrows);
  figure.marks = static_cast<std::size_t>(arrows);
  figure.body += "<div class=\"pair\">";
  for (const auto& [name, words] : {std::pair{"sigma_a_px", "3σ of A"}, std::pair{"sigma_b_px", "3σ of B"}})
    if (const std::vector<double> sigma = times(3.0, grid->value(name)); largest_size(sigma) > 0.0)
      figure.body += "<figure>" +
                     field_map({words, name, "", "", sigma}, *grid, panel_of(document, *grid, half), half, none) +
                     "</figure>";
  figure.body += "</div>" + colour_key(map_width);
  figure.good = fmt::format("Half of the picture differs by less than {} px, 95 % of it by less than {} px.",
                            number_text(quantile(size, 0.5), 2), number_text(quantile(size, 0.95), 2));
  return figure;
}

MaybeFigure figure_diagonal(const Document& document) {
  const Grid* grid = document.grid("diff");
  if (!grid) return std::nullopt;
  const DiagonalCurves curves = diagonal_curves(*grid);
  const double highest =
      std::max({largest_size(curves.size), largest_size(curves.three_sigma_a), largest_size(curves.three_sigma_b)});
  if (!(highest > 0.0)) return std::nullopt;
  const double low = round_down_125(std::max(1e-4 * highest, quantile(curves.size, 0.02)));
  constexpr double width = 520.0, left = 56.0, right = width - 12.0, top = 30.0, bottom = 250.0;
  const Scale x{0.0, curves.along_px.back(), left, right}, y{low, round_up_125(highest), bottom, top, true};
  Svg svg(width, bottom + 42.0, "Difference along the picture's diagonal beside the 3σ of each camera");
  for (const double tick : log_ticks(y.low, y.high)) {
    svg.line({left, y(tick)}, {right, y(tick)}, "gridline");
    svg.text({left - 6.0, y(tick) + 4.0}, number_text(tick, 3), "tick", "end");
  }
  for (const double tick : linear_ticks(0.0, x.high, 5))
    svg.text({x(tick), bottom + 16.0}, number_text(tick, 4), "tick", "middle");
  svg.text({0.5 * (left + right), bottom + 36.0}, "along the diagonal from the top-left corner, px", "tick", "middle");
  double legend = left;
  const std::vector<std::tuple<const char*, const std::vector<double>*, const char*>> lines{
      {"difference, px", &curves.size, "curve"},
      {"3σ of A", &curves.three_sigma_a, "curve-blue"},
      {"3σ of B", &curves.three_sigma_b, "curve-orange"}};
  for (const auto& [words, values, look] : lines) {
    if (!std::isfinite(quantile(*values, 0.5))) continue;
    draw_curve(svg, x, y, curves.along_px, *values, look);
    svg.line({legend, 10.0}, {legend + 24.0, 10.0}, look);
    svg.text({legend + 30.0, 14.0}, words, "small");
    legend += 30.0 + text_width(words, 11.0) + 18.0;
  }
  Figure figure{.id = "diagonal", .title = "Where along the diagonal?", .note = "px", .body = svg.str(), .span = 10};
  figure.good = "Good: the difference stays below the 3σ of both.";
  figure.marks = curves.size.size();
  return figure;
}

MaybeFigure figure_parameters(const Document& document) {
  const Table* table = document.table("parameters");
  if (!table) return std::nullopt;
  Figure figure{.id = "parameters",
                .title = "Which parameters differ?",
                .note = "value ± 3σ; difference in σ of the difference",
                .span = 14};
  std::string rows;
  for (std::size_t row = 0; row < table->num_rows; ++row) {
    const double a = table->number("a", row), b = table->number("b", row), sigma_a = table->number("sigma_a", row),
                 sigma_b = table->number("sigma_b", row), sigma = std::hypot(sigma_a, sigma_b);
    const auto cell = [](const ValueText& words) {
      return "<td class=\"value\">" + words.value + "</td><td>" +
             (words.plus_minus.empty() ? "" : "± " + words.plus_minus) + "</td>";
    };
    const double difference = (b - a) / sigma;
    rows += "<tr><th>" + escaped(table->text("name", row)) + "</th>" + cell(value_text(a, sigma_a)) +
            cell(value_text(b, sigma_b)) + "<td class=\"value\">" + number_text(b - a, 3) +
            "</td><td class=\"value\">" + (std::isfinite(difference) ? fmt::format("{:.1f} σ", difference) : "–") +
            "</td></tr>";
  }
  figure.body =
      "<div class=\"scroll\"><table class=\"estimate\"><thead><tr><th></th><th colspan=\"2\">A</th><th "
      "colspan=\"2\">B</th><th>B − A</th><th>in σ</th></tr></thead>" +
      rows + "</table></div>";
  figure.good = "Parameters trade against each other: what counts is how far apart the pixels are.";
  figure.marks = table->num_rows;
  return figure;
}

}  // namespace alidade::report
