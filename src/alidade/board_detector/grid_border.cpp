#include "alidade/board_detector/grid_border.h"
#include "alidade/estimation/median.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "alidade/corners/corner_fit.h"

namespace alidade {
namespace {

constexpr double min_joining_contrast = 0.3;  // of the corners known, for one that joins
constexpr double min_seen = 0.6;              // part of a side that has to be in the image
constexpr double min_alternation = 0.4;       // of the outer squares, 1 where they are as black and white as the others
constexpr double max_alternation_beyond = 0.3;
constexpr std::size_t max_probes = 12;  // corners that give the contrast

/// A side of a grid: the direction outwards, and its corners' positions.
struct Side {
  int di, dj;
  std::vector<GridCell> cells;
};

/// In the order of GridBorders: i_min, i_max, j_min, j_max.
Side side_of(const GridExtent& extent, int number) {
  Side side{
      .di = number == 0 ? -1 : (number == 1 ? 1 : 0), .dj = number == 2 ? -1 : (number == 3 ? 1 : 0), .cells = {}};
  if (number < 2) {
    for (int j = extent.j_min; j <= extent.j_max; ++j)
      side.cells.push_back({number == 0 ? extent.i_min : extent.i_max, j});
  } else {
    for (int i = extent.i_min; i <= extent.i_max; ++i)
      side.cells.push_back({i, number == 2 ? extent.j_min : extent.j_max});
  }
  return side;
}

CornerFit fit_at(const cv::Mat& photo, const GridCorner& corner) {
  return fit_corner(photo, {.px = corner.px, .along_cols = corner.step_i, .along_rows = corner.step_j});
}

double parity_sign(int i, int j) { return (i + j) % 2 == 0 ? 1.0 : -1.0; }

/// Median of parity times contrast over some corners of the grid; 0 where none can be fitted.
double typical_contrast(const cv::Mat& photo, const CornerGrid& grid) {
  std::vector<double> contrasts;
  const std::size_t stride = grid.corners.size() / max_probes + 1;
  std::size_t number = 0;
  for (const auto& [cell, corner] : grid.corners) {
    if (number++ % stride != 0) continue;
    const CornerFit fit = fit_at(photo, corner);
    if (fit.accepted()) contrasts.push_back(parity_sign(cell.first, cell.second) * fit.contrast);
  }
  return median_of(std::move(contrasts));
}

/// The corners of the line outside a side that can be fitted; empty if they are fewer than half.
std::vector<std::pair<GridCell, GridCorner>> fitted_line(const cv::Mat& photo, const CornerGrid& grid, const Side& side,
                                                         double contrast) {
  std::vector<std::pair<GridCell, GridCorner>> line;
  for (const auto& [i, j] : side.cells) {
    const GridCell cell{i + side.di, j + side.dj};
    auto corner = predict_corner(grid, cell.first, cell.second);
    if (!corner) continue;
    const CornerFit fit = fit_at(photo, *corner);
    const double same_colours = parity_sign(cell.first, cell.second) * fit.contrast * contrast;
    if (!fit.accepted() || !(same_colours > min_joining_contrast * contrast * contrast)) continue;
    corner->px = fit.px;
    line.emplace_back(cell, *corner);
  }
  if (2 * line.size() < side.cells.size()) line.clear();
  return line;
}

/// Mean of 3×3 pixels; NaN outside the image.
double mean_grey_at(const cv::Mat& photo, const Eigen::Vector2d& px) {
  const int x = static_cast<int>(std::lround(std::clamp(px.x(), -10.0, 1e6)));
  const int y = static_cast<int>(std::lround(std::clamp(px.y(), -10.0, 1e6)));
  if (x < 1 || y < 1 || x >= photo.cols - 1 || y >= photo.rows - 1) return std::nan("");
  return cv::mean(photo(cv::Rect(x - 1, y - 1, 3, 3)))[0];
}

/// How much the squares at `depth` squares outside a side alternate, 1 as much as the board's; and how many are seen.
struct Alternation {
  double strength = 0.0, seen = 0.0;
};
Alternation alternation_at(const cv::Mat& photo, const CornerGrid& grid, const Side& side, double contrast,
                           double depth) {
  double signed_sum = 0.0, sum = 0.0, sign_sum = 0.0;
  int count = 0;
  for (std::size_t k = 0; k + 1 < side.cells.size(); ++k) {
    const auto [i, j] = side.cells[k];
    const GridCorner *one = grid.at(i, j), *two = grid.at(side.cells[k + 1].first, side.cells[k + 1].second);
    const auto out = predict_corner(grid, i + side.di, j + side.dj);
    const auto out_two = predict_corner(grid, side.cells[k + 1].first + side.di, side.cells[k + 1].second + side.dj);
    if (!one || !two || !out || !out_two) continue;
    const Eigen::Vector2d step = 0.5 * (out->px - one->px + out_two->px - two->px);
    const double grey = mean_grey_at(photo, 0.5 * (one->px + two->px) + depth * step);
    if (std::isnan(grey)) continue;
    // The square from (i, j) to (i + 1, j + 1) has the corner's own sign; outwards of a lower side it is one before.
    const int outer_i = i + (side.di < 0 ? -1 : 0), outer_j = j + (side.dj < 0 ? -1 : 0);
    const double sign = parity_sign(outer_i, outer_j) * (contrast > 0.0 ? 1.0 : -1.0);
    signed_sum += sign * grey;
    sign_sum += sign;
    sum += grey;
    ++count;
  }
  if (count < 2) return {};
  const double mean = sum / count;
  return {(signed_sum - sign_sum * mean) / (count * std::abs(contrast)),
          count / static_cast<double>(side.cells.size() - 1)};
}

}  // namespace

void extend_by_fit(const cv::Mat& photo, CornerGrid& grid, int max_lines) {
  const double contrast = typical_contrast(photo, grid);
  if (contrast == 0.0) return;
  for (int number = 0; number < 4; ++number) {
    for (;;) {
      const GridExtent extent = extent_of(grid);
      if ((number < 2 ? extent.width() : extent.height()) >= max_lines) break;
      const auto line = fitted_line(photo, grid, side_of(extent, number), contrast);
      if (line.empty()) break;
      grid.corners.insert(line.begin(), line.end());
    }
  }
}

GridBorders find_borders(const cv::Mat& photo, const CornerGrid& grid) {
  GridBorders borders{};
  const double contrast = typical_contrast(photo, grid);
  if (contrast == 0.0) return borders;
  const GridExtent extent = extent_of(grid);
  for (int number = 0; number < 4; ++number) {
    const Side side = side_of(extent, number);
    const Alternation outer = alternation_at(photo, grid, side, contrast, 0.5);
    const Alternation at_edge = alternation_at(photo, grid, side, contrast, 1.1);
    const Alternation beyond = alternation_at(photo, grid, side, contrast, 1.5);
    borders[static_cast<std::size_t>(number)] = outer.seen >= min_seen && at_edge.seen >= min_seen &&
                                                outer.strength > min_alternation &&
                                                std::abs(beyond.strength) < max_alternation_beyond;
  }
  return borders;
}

}  // namespace alidade
