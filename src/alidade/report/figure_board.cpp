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

constexpr double width = 460.0;

struct BoardShapePlot {
  double limit_mm = 1.0;      // of the colours
  double arrow_factor = 1.0;  // paper units per mm
  double bar_mm = 1.0;
};

void draw_height_bar(Svg& svg, double top, double limit_mm) {
  constexpr double left = 60.0, right = width - 60.0;
  constexpr int pieces = 60;
  const double piece = (right - left) / pieces;
  for (int i = 0; i < pieces; ++i)
    svg.rect({left + piece * i, top}, piece + 0.4, 9.0, "",
             fmt::format("fill=\"{}\"", hex(diverging(2.0 * (i + 0.5) / pieces - 1.0))));
  const Scale x{-limit_mm, limit_mm, left, right};
  for (const double share : {-1.0, -0.5, 0.0, 0.5, 1.0})
    svg.text({x(share * limit_mm), top + 24.0}, number_text(share * limit_mm, 2), "tick", "middle");
  svg.text({0.5 * (left + right), top + 39.0}, "height off the printed plane, mm", "tick", "middle");
}

std::string shape_map(const Table& points, double limit_mm, std::size_t& marks) {
  const auto col = points.numbers("col"), row = points.numbers("row"), dx = times(1e3, points.numbers("dx_m")),
             dy = times(1e3, points.numbers("dy_m")), dz = times(1e3, points.numbers("dz_m"));
  const double cols = largest_size(col), rows = largest_size(row);
  const double pitch = std::min((width - 60.0) / std::max(1.0, cols + 0.6), 320.0 / std::max(1.0, rows + 0.6));
  const double left = 0.5 * (width - pitch * cols), top = 0.5 * pitch + 8.0, bottom = top + pitch * rows + 0.5 * pitch;
  const double in_plane_mm = quantile(lengths(dx, dy), 0.95);
  const double factor = in_plane_mm > 0.0 ? round_down_125(0.45 * pitch / in_plane_mm) : 0.0;
  Svg svg(width, bottom + (factor > 0.0 ? 84.0 : 54.0),
          fmt::format("Heights of the board's points, at most {} mm", number_text(largest_size(dz), 2)));
  std::string arrows;
  for (std::size_t i = 0; i < points.num_rows; ++i) {
    if (!std::isfinite(col[i]) || !std::isfinite(row[i]) || !std::isfinite(dz[i])) continue;
    const Place at{left + pitch * col[i], top + pitch * row[i]};
    const double sigma = 1e3 * points.number("sigma_dz_m", i);
    svg.circle(at, 0.36 * pitch, "board-point", fmt::format("fill=\"{}\"", hex(diverging(dz[i] / limit_mm))));
    if (sigma > 0.0 && std::abs(dz[i]) > 3.0 * sigma) svg.circle(at, 0.36 * pitch + 1.5, "board-ring");
    if (factor > 0.0) append_arrow(arrows, at, {at.x + factor * dx[i], at.y + factor * dy[i]}, 4.0);
    ++marks;
  }
  if (marks == 0) return "";
  svg.path(arrows, "halo");
  svg.path(arrows, "vector");
  draw_height_bar(svg, bottom + 4.0, limit_mm);
  if (factor > 0.0) {
    const double bar_mm = round_down_125(70.0 / factor);
    draw_scale_bar(svg, {60.0, bottom + 66.0}, bar_mm * factor, number_text(bar_mm, 2) + " mm, arrows within the plane",
                   false);
  }
  return svg.str();
}

// `transfer_rms_px` is a number, or has one for each direction.
std::string transfer_words(const Document& document) {
  std::string items;
  for (const Quantity& quantity : document.estimate) {
    if (quantity.path.rfind("transfer", 0) != 0) continue;
    std::string name = quantity.path;
    std::replace(name.begin(), name.end(), '_', ' ');
    if (name.size() > 3 && name.compare(name.size() - 3, 3, " px") == 0) name.erase(name.size() - 3);
    const bool is_number = std::isfinite(quantity.value);
    items += "<tr><th>" + escaped(name) + "</th><td class=\"value\">" +
             (is_number               ? number_text(quantity.value, 3)
              : quantity.text.empty() ? "–"
                                      : escaped(quantity.text)) +
             "</td><td>" + (is_number ? "px" : "") + "</td></tr>";
  }
  return items.empty() ? "" : "<table class=\"estimate\">" + items + "</table>";
}

}  // namespace

MaybeFigure figure_board(const CalibrateScene& scene) {
  const Table* points = scene.document.table("board_points");
  if (!points) return std::nullopt;
  Figure figure{.id = "board", .title = "Is the board flat?", .note = "mm", .span = 7};
  const double highest_mm = 1e3 * largest_size(points->numbers("dz_m"));
  const std::string map = shape_map(*points, std::max(0.1, round_up_125(highest_mm)), figure.marks);
  if (figure.marks == 0) return std::nullopt;
  const bool is_held_flat = !(highest_mm > 0.0) && !(largest_size(points->numbers("dx_m")) > 0.0);
  figure.body = is_held_flat ? "<p>The board was held flat, so its heights are not shown.</p>" : map;
  figure.body += transfer_words(scene.document);
  figure.good =
      is_held_flat
          ? "RMS on unseen photos, with the shape learned on the others and flat: much smaller with it means that "
            "the board bends."
          : fmt::format("Ringed: further than 3σ from flat. Highest {} mm.", number_text(highest_mm, 2));
  if (const std::string shape = scene.document.estimated_text("board_shape"); !shape.empty())
    figure.good += " Solved as: " + shape + ".";
  return figure;
}

}  // namespace alidade::report
