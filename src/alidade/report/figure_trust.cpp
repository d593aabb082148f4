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

struct TrustMap {
  const char* grid_name;
  const char* words;
  const char* line;  // its look in the share plot
};

constexpr TrustMap trust_maps[] = {{"sigma_infinity", "at infinity", "curve"},
                                   {"sigma_working", "at the working distance", "curve-dashed"}};

std::string map_of(const CalibrateScene& scene, const Grid& grid, const std::vector<double>& three_sigma_px,
                   const TrustMap& map) {
  const PicturePanel panel = scene.panel(map_width);
  const std::string label =
      fmt::format("3σ of projection {}: between {} and {} px, {} px in the middle of the values", map.words,
                  number_text(quantile(three_sigma_px, 0.0), 2), number_text(quantile(three_sigma_px, 1.0), 2),
                  number_text(quantile(three_sigma_px, 0.5), 2));
  Svg svg(map_width, panel.height(), label);
  panel.frame(svg);
  draw_heat(svg, panel, grid, three_sigma_px, std::string("clip-") + map.grid_name);
  svg.raw("<use href=\"#all-corners\" class=\"corner-dots\"/>");
  draw_contours(svg, panel, grid, three_sigma_px);
  return svg.str();
}

// The share of the picture under each 3σ: the values, sorted.
void draw_share(Svg& svg, const Scale& x, const Scale& y, std::vector<double> values, const char* look) {
  const std::size_t all = values.size();
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return;
  std::sort(values.begin(), values.end());
  std::vector<Place> line{{std::clamp(x(values.front()), x.from, x.to), y(0.0)}};
  const std::size_t step = std::max<std::size_t>(1, values.size() / 200);
  for (std::size_t i = 0; i < values.size(); i += step)
    line.push_back(
        {std::clamp(x(values[i]), x.from, x.to), y(100.0 * static_cast<double>(i + 1) / static_cast<double>(all))});
  const double last = y(100.0 * static_cast<double>(values.size()) / static_cast<double>(all));
  line.push_back({std::clamp(x(values.back()), x.from, x.to), last});
  line.push_back({x.to, last});
  svg.polyline(line, look);
}

std::string share_plot(const std::vector<std::pair<TrustMap, std::vector<double>>>& maps) {
  constexpr double left = 52.0, right = map_width - 14.0, top = 26.0, bottom = 120.0;
  Svg svg(map_width, bottom + 48.0, "Share of the picture whose 3σ is below each size");
  const Scale x{PixelColours::low_px, PixelColours::high_px, left, right, true}, y{0.0, 100.0, bottom, top};
  for (const double percent : {0.0, 50.0, 100.0}) {
    svg.line({left, y(percent)}, {right, y(percent)}, "gridline");
    svg.text({left - 6.0, y(percent) + 4.0}, fmt::format("{:.0f} %", percent), "tick", "end");
  }
  double legend = 0.0;
  svg.text({8.0, 14.0}, "share of the picture below …", "small");
  legend = 196.0;
  for (const auto& [map, values] : maps) {
    draw_share(svg, x, y, values, map.line);
    svg.line({legend, 10.0}, {legend + 24.0, 10.0}, map.line);
    svg.text({legend + 29.0, 14.0}, map.words, "small");
    legend += 29.0 + text_width(map.words, 11.0) + 6.0;
  }
  draw_pixel_colour_bar(svg, left, right, bottom + 2.0, "3σ of projection, px");
  return svg.str();
}

}  // namespace

MaybeFigure figure_trust(const CalibrateScene& scene) {
  if (!scene.has_picture_size()) return std::nullopt;
  std::vector<std::pair<TrustMap, std::vector<double>>> maps;
  std::string choices, panels;
  for (const TrustMap& map : trust_maps) {
    const Grid* grid = scene.document.grid(map.grid_name);
    if (!grid) continue;
    const std::vector<double> three_sigma_px = times(3.0, grid->value("sigma_px"));
    if (!(largest_size(three_sigma_px) > 0.0)) continue;
    const char* checked = maps.empty() ? " checked" : "";
    choices += fmt::format("<label><input type=\"radio\" name=\"trust\" value=\"{}\"{}> {}</label> ", map.grid_name,
                           checked, map.words);
    panels += fmt::format("<div class=\"choice\" data-choice=\"{}\"{}>", map.grid_name, maps.empty() ? "" : " hidden") +
              map_of(scene, *grid, three_sigma_px, map) + "</div>";
    maps.emplace_back(map, three_sigma_px);
  }
  if (maps.empty()) return std::nullopt;
  Figure figure{.id = "trust", .title = "Where can I trust a pixel?", .note = "3σ of projection, px", .span = 9};
  if (maps.size() > 1) figure.body = "<div class=\"choices\">" + choices + "</div>";
  figure.body += panels + share_plot(maps);
  figure.good = "Good: below a third of the accuracy that the task needs, everywhere it looks. Dots: corners.";
  figure.marks = maps.size();
  return figure;
}

}  // namespace alidade::report
