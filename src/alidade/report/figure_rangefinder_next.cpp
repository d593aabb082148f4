#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "alidade/report/colours.h"
#include "alidade/report/figures.h"
#include "alidade/report/markup.h"
#include "alidade/report/scale.h"
#include "alidade/report/svg.h"

namespace alidade::report {
namespace {

constexpr double degrees = 180.0 / std::numbers::pi;
constexpr double width = 560.0, left = 50.0, right = width - 8.0, top = 8.0;

struct Cell {
  double distance_m = 0.0, tilt_rad = 0.0, sigma_mm = 0.0;
};

struct Choices {
  std::vector<Cell> cells;
  std::vector<double> distances, tilts;  ///< Each once, growing.
  std::size_t best = 0;
  double low_mm = 0.0, high_mm = 0.0;
};

/// By their values, not by their places: a cell may be missing. Not a grid of pixels.
Choices choices_of(const Grid& grid) {
  Choices choices;
  const auto values = [&](const char* name) {
    const auto found = grid.values.find(name);
    return found == grid.values.end() ? std::vector<double>{} : found->second;
  };
  const std::vector<double> distance = values("distance_m"), tilt = values("tilt_rad"), sigma = values("sigma_point_m");
  std::set<double> distances, tilts;
  for (std::size_t i = 0; i < std::min({distance.size(), tilt.size(), sigma.size()}); ++i) {
    if (!(distance[i] > 0.0 && distance[i] < 1e6) || !(std::abs(tilt[i]) < 10.0) || !(sigma[i] > 0.0 && sigma[i] < 1e6))
      continue;
    choices.cells.push_back({distance[i], tilt[i], 1e3 * sigma[i]});
    distances.insert(distance[i]);
    tilts.insert(tilt[i]);
    if (choices.cells.back().sigma_mm < choices.cells[choices.best].sigma_mm) choices.best = choices.cells.size() - 1;
  }
  choices.distances.assign(distances.begin(), distances.end());
  choices.tilts.assign(tilts.begin(), tilts.end());
  if (choices.cells.empty()) return choices;
  choices.low_mm = choices.high_mm = choices.cells[choices.best].sigma_mm;
  for (const Cell& cell : choices.cells) choices.high_mm = std::max(choices.high_mm, cell.sigma_mm);
  return choices;
}

/// A factor of 1.25 is the least that the colours span: where all choices are alike they look alike.
double share_of(const Choices& choices, double sigma_mm) {
  return std::log(sigma_mm / choices.low_mm) / std::log(std::max(1.25, choices.high_mm / choices.low_mm));
}

std::string words_of(const Cell& cell) {
  return fmt::format("board {} m away along the beam, tilted {:.0f}°", number_text(cell.distance_m, 2),
                     degrees * cell.tilt_rad);
}

struct Layout {
  double cell_width, cell_height;
  [[nodiscard]] Place corner(const Choices& choices, const Cell& cell) const {
    const auto place = [](const std::vector<double>& all, double value) {
      return static_cast<double>(std::ranges::find(all, value) - all.begin());
    };
    return {left + cell_width * place(choices.distances, cell.distance_m),
            top + cell_height * place(choices.tilts, cell.tilt_rad)};
  }
  [[nodiscard]] double bottom(const Choices& choices) const {
    return top + cell_height * static_cast<double>(choices.tilts.size());
  }
};

void draw_cells(Svg& svg, const Choices& choices, const Layout& layout) {
  const bool has_numbers = layout.cell_width >= 34.0 && layout.cell_height >= 16.0;
  for (const Cell& cell : choices.cells) {
    const Place corner = layout.corner(choices, cell);
    const double share = share_of(choices, cell.sigma_mm);
    svg.raw(fmt::format("<g><title>{}: σ {} mm</title>", escaped(words_of(cell)), number_text(cell.sigma_mm, 3)));
    svg.rect(corner, layout.cell_width - 1.0, layout.cell_height - 1.0, "",
             fmt::format("fill=\"{}\"", hex(cividis(share))));
    if (has_numbers)
      svg.text({corner.x + 0.5 * layout.cell_width, corner.y + 0.5 * layout.cell_height + 4.0},
               rounded_text(cell.sigma_mm, 3), "cell-number", "start",
               share < 0.55 ? "fill=\"#fff\"" : "fill=\"#111\"");
    svg.raw("</g>");
  }
  const Place best = layout.corner(choices, choices.cells[choices.best]);
  svg.rect({best.x + 0.5, best.y + 0.5}, layout.cell_width - 2.0, layout.cell_height - 2.0, "best-cell");
}

void draw_axes(Svg& svg, const Choices& choices, const Layout& layout) {
  const double bottom = layout.bottom(choices);
  const auto every = [](double size, double least) {
    return std::max<std::size_t>(1, static_cast<std::size_t>(std::ceil(least / size)));
  };
  for (std::size_t i = 0; i < choices.distances.size(); i += every(layout.cell_width, 34.0))
    svg.text({left + layout.cell_width * (static_cast<double>(i) + 0.5), bottom + 15.0},
             number_text(choices.distances[i], 2), "tick", "middle");
  for (std::size_t i = 0; i < choices.tilts.size(); i += every(layout.cell_height, 14.0))
    svg.text({left - 6.0, top + layout.cell_height * (static_cast<double>(i) + 0.5) + 4.0},
             fmt::format("{:.0f}°", degrees * choices.tilts[i]), "tick", "end");
  svg.text({0.5 * (left + right), bottom + 32.0}, "distance of the board along the beam, m; tilt downwards", "tick",
           "middle");
}

void draw_colour_bar(Svg& svg, const Choices& choices, double y) {
  constexpr int pieces = 48;
  const double high = std::max(choices.high_mm, 1.25 * choices.low_mm), from = left + 150.0,
               step = (right - 30.0 - from) / pieces;
  for (int i = 0; i < pieces; ++i)
    svg.rect({from + step * i, y}, step + 0.4, 9.0, "", fmt::format("fill=\"{}\"", hex(cividis((i + 0.5) / pieces))));
  svg.text({from - 8.0, y + 9.0}, "σ of a measured point, mm", "tick", "end");
  for (const double share : {0.0, 0.5, 1.0})
    svg.text({from + share * step * pieces, y + 24.0},
             number_text(choices.low_mm * std::pow(high / choices.low_mm, share), 3), "tick", "middle");
}

}  // namespace

MaybeFigure figure_rangefinder_next(const RangefinderScene& scene) {
  const auto grid = scene.document.grids.find("next_shot");
  if (grid == scene.document.grids.end()) return std::nullopt;
  const Choices choices = choices_of(grid->second);
  if (choices.cells.empty()) return std::nullopt;
  const Layout layout{(right - left) / static_cast<double>(choices.distances.size()),
                      std::clamp(240.0 / static_cast<double>(choices.tilts.size()), 4.0, 52.0)};
  const Cell& best = choices.cells[choices.best];
  const double bottom = layout.bottom(choices);
  Svg svg(width, bottom + 76.0,
          fmt::format("Best next shot: {}; it leaves {} mm, the worst choice {} mm", words_of(best),
                      number_text(best.sigma_mm, 3), number_text(choices.high_mm, 3)));
  draw_cells(svg, choices, layout);
  draw_axes(svg, choices, layout);
  draw_colour_bar(svg, choices, bottom + 44.0);
  Figure figure{.id = "next", .title = "Which shot next?", .note = "what one more shot would leave, mm", .span = 8};
  figure.body = svg.str();
  figure.good = fmt::format("Best, framed: {}. A point along the beam then has σ {} mm; after the worst choice {} mm.",
                            words_of(best), number_text(best.sigma_mm, 3), number_text(choices.high_mm, 3));
  if (choices.high_mm < 1.02 * choices.low_mm)
    figure.good += " All choices are nearly alike: one more shot hardly helps.";
  figure.marks = choices.cells.size();
  return figure;
}

}  // namespace alidade::report
