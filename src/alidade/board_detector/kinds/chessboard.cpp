#include "alidade/board_detector/kinds/chessboard.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "alidade/board_detector/grid_border.h"
#include "alidade/board_detector/grid_placement.h"
#include "alidade/corners/saddle_points.h"

namespace alidade {
namespace {

constexpr double max_pixels = 1.7e6;  // of an image that is searched; larger photos are halved first
constexpr int min_side_px = 60;
constexpr std::size_t min_corners_to_extend = 9;
constexpr const char* no_corners = "no chessboard corners";

cv::Mat resized(const cv::Mat& photo, double factor) {
  cv::Mat result;
  cv::resize(photo, result, {}, factor, factor, factor < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  return result;
}

/// Pixel centres are whole numbers in both images.
void to_photo_pixels(CornerGrid& grid, double scale) {
  for (auto& [cell, corner] : grid.corners) {
    corner.px = (corner.px.array() + 0.5) * scale - 0.5;
    corner.step_i *= scale;
    corner.step_j *= scale;
  }
}

/// A grid as found and as numbered.
struct Candidate {
  CornerGrid grid;
  PlacedGrid placed;
  double scale = 1.0;
  [[nodiscard]] bool is_placed() const { return placed.reason.empty(); }
};

/// A placed grid before none, then the one with more corners.
bool is_better(const Candidate& a, const Candidate& b) {
  if (a.is_placed() != b.is_placed()) return a.is_placed();
  return a.grid.corners.size() > b.grid.corners.size();
}

/// The best board at one size of the image.
Candidate search(const cv::Mat& image, double scale, int cols, int rows) {
  Candidate best{.grid = {}, .placed = {.grid = {}, .reason = no_corners}, .scale = scale};
  const std::vector<SaddlePoint> points = find_saddle_points(image);
  for (CornerGrid& grid : grow_grids(image, points)) {
    to_photo_pixels(grid, scale);
    PlacedGrid placed = place_grid(grid, cols, rows);
    Candidate candidate{.grid = std::move(grid), .placed = std::move(placed), .scale = scale};
    if (is_better(candidate, best)) best = std::move(candidate);
  }
  return best;
}

/// A grid that cannot be placed as it is: missed lines are looked for, then the board's borders.
void place_by_borders(const cv::Mat& photo, Candidate& candidate, int cols, int rows) {
  if (candidate.is_placed() || candidate.grid.corners.size() < min_corners_to_extend) return;
  extend_by_fit(photo, candidate.grid, std::max(cols, rows) + 1);
  candidate.placed = place_grid(candidate.grid, cols, rows, find_borders(photo, candidate.grid));
}

}  // namespace

Chessboard find_chessboard(const cv::Mat& photo, int cols, int rows) {
  double first = 1.0;
  const double pixels = static_cast<double>(photo.total());
  while (pixels / (first * first) > max_pixels) first *= 2.0;
  Candidate best{.grid = {}, .placed = {.grid = {}, .reason = no_corners}, .scale = first};
  const auto whole = static_cast<std::size_t>(cols * rows);
  for (const double scale : {first, 2.0 * first, 4.0 * first, 0.5 * first}) {
    if (scale > first && std::min(photo.rows, photo.cols) / scale < min_side_px) continue;
    if (scale < first && pixels / (scale * scale) > max_pixels) continue;
    Candidate candidate = search(scale == 1.0 ? photo : resized(photo, 1.0 / scale), scale, cols, rows);
    if (is_better(candidate, best)) best = std::move(candidate);
    if (best.is_placed() && best.placed.grid.corners.size() == whole) break;
  }
  place_by_borders(photo, best, cols, rows);
  return {.grid = std::move(best.placed.grid), .pixel_scale = best.scale, .reason = std::move(best.placed.reason)};
}

Chessboard find_chessboard_at(const cv::Mat& photo, int cols, int rows, double scale) {
  Candidate best = search(scale == 1.0 ? photo : resized(photo, 1.0 / scale), scale, cols, rows);
  return {.grid = std::move(best.placed.grid), .pixel_scale = best.scale, .reason = std::move(best.placed.reason)};
}

}  // namespace alidade
