#include "alidade/imaging/chessboard.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "alidade/imaging/grid_placement.h"
#include "alidade/imaging/saddle_points.h"

namespace alidade {
namespace {

constexpr double max_pixels = 1.7e6;  // of a picture that is searched; larger photos are halved first
constexpr int min_side_px = 60;

cv::Mat resized(const cv::Mat& photo, double factor) {
  cv::Mat result;
  cv::resize(photo, result, {}, factor, factor, factor < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  return result;
}

/// Pixel centres are whole numbers in both pictures.
void to_photo_pixels(CornerGrid& grid, double scale) {
  for (auto& [cell, corner] : grid.corners) {
    corner.px = (corner.px.array() + 0.5) * scale - 0.5;
    corner.step_i *= scale;
    corner.step_j *= scale;
  }
}

/// Better: a placed grid before none, then the one with more corners; a reason about a larger grid tells more.
bool is_better(const Chessboard& a, const Chessboard& b) {
  if (a.reason.empty() != b.reason.empty()) return a.reason.empty();
  return a.grid.corners.size() > b.grid.corners.size();
}

/// The best board at one size of the picture.
Chessboard search(const cv::Mat& picture, double scale, int cols, int rows) {
  Chessboard best{.grid = {}, .pixel_scale = scale, .reason = "no chessboard corners"};
  const std::vector<SaddlePoint> points = find_saddle_points(picture);
  for (CornerGrid& grid : grow_grids(points)) {
    to_photo_pixels(grid, scale);
    PlacedGrid placed = place_grid(grid, cols, rows);
    const bool is_placed = placed.reason.empty();
    Chessboard board{.grid = is_placed ? std::move(placed.grid) : std::move(grid),
                     .pixel_scale = scale,
                     .reason = std::move(placed.reason)};
    if (is_better(board, best)) best = std::move(board);
  }
  return best;
}

}  // namespace

Chessboard find_chessboard(const cv::Mat& photo, int cols, int rows) {
  double first = 1.0;
  const double pixels = static_cast<double>(photo.total());
  while (pixels / (first * first) > max_pixels) first *= 2.0;
  Chessboard best{.grid = {}, .pixel_scale = first, .reason = "no chessboard corners"};
  const auto whole = static_cast<std::size_t>(cols * rows);
  for (const double scale : {first, 2.0 * first, 4.0 * first, 0.5 * first}) {
    const bool too_small = std::min(photo.rows, photo.cols) / scale < min_side_px;
    if (scale > first && too_small) continue;
    if (scale < first && pixels / (scale * scale) > max_pixels) continue;
    Chessboard board = search(scale == 1.0 ? photo : resized(photo, 1.0 / scale), scale, cols, rows);
    if (is_better(board, best)) best = std::move(board);
    if (best.reason.empty() && best.grid.corners.size() == whole) break;
  }
  return best;
}

}  // namespace alidade
