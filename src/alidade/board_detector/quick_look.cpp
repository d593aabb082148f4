#include "alidade/board_detector/quick_look.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "alidade/board_detector/find_board.h"
#include "alidade/board_detector/kinds/chessboard.h"
#include "alidade/corners/corner_fit.h"
#include "alidade/estimation/median.h"
#include "alidade/imaging/grey_photo.h"

namespace alidade {
namespace {

constexpr double quick_pixels = 0.6e6;  // of an image that is searched: VGA and SVGA at full size
constexpr int min_halved_px = 120;
constexpr double min_roomy_px = 24.0;  // around the board's last position

double quick_scale(double pixels) {
  double scale = 1.0;
  while (pixels / (scale * scale) > quick_pixels) scale *= 2.0;
  return scale;
}

std::pair<int, int> grid_in(const std::string& reason, const Board& given) {
  std::pair<int, int> size{0, 0};
  if (std::sscanf(reason.c_str(), "a grid of %d×%d", &size.first, &size.second) != 2 &&
      std::sscanf(reason.c_str(), "only %d×%d of", &size.first, &size.second) != 2)
    return {0, 0};
  const bool is_given = size == std::pair(given.cols, given.rows) || size == std::pair(given.rows, given.cols);
  return is_given ? std::pair(0, 0) : size;
}

/// Median blur of a few corners, each fitted by its edges.
double blur_of(const cv::Mat& grey, const CornerGrid& grid, double scale) {
  constexpr std::size_t enough = 7;
  std::vector<double> blurs;
  const std::size_t step = std::max<std::size_t>(1, grid.corners.size() / enough);
  std::size_t at = 0;
  for (const auto& [cell, corner] : grid.corners) {
    if (at++ % step != 0) continue;
    const auto* right = grid.at(cell.first + 1, cell.second);
    const auto* below = grid.at(cell.first, cell.second + 1);
    if (!right || !below) continue;
    CornerFitConfig config;
    config.max_move_px = std::max(2.0, 1.5 * scale);
    const CornerFit fit = fit_corner(
        grey,
        {.px = corner.px, .along_cols = right->px - corner.px, .along_rows = below->px - corner.px, .blur_px = scale},
        config);
    if (fit.accepted()) blurs.push_back(fit.blur_px);
  }
  return blurs.empty() ? 0.0 : median_of(blurs);
}

}  // namespace

QuickLook QuickLooker::look_in(const cv::Mat& photo, int left_px, int top_px, int width_px, int height_px) {
  QuickLook look;
  const cv::Mat part = photo(cv::Rect(left_px, top_px, width_px, height_px));
  const double scale = quick_scale(static_cast<double>(photo.total()));
  cv::Mat small;  // eight bits are halved faster than floats
  if (scale > 1.0) cv::resize(one_channel(part), small, {}, 1.0 / scale, 1.0 / scale, cv::INTER_AREA);
  const cv::Mat grey = to_grey_photo(scale > 1.0 ? small : part, look.reason);
  if (!look.reason.empty()) return look;
  Chessboard found = find_chessboard_at(grey, board_.cols, board_.rows, 1.0);
  if (!found.reason.empty() && std::min(grey.rows, grey.cols) >= min_halved_px) {  // large squares, or blurred ones
    Chessboard halved = find_chessboard_at(grey, board_.cols, board_.rows, 2.0);
    if (halved.reason.empty()) found = std::move(halved);
  }
  look.reason = found.reason;
  look.other_grid = grid_in(found.reason, board_);
  const std::size_t whole = static_cast<std::size_t>(num_points(board_));
  if (look.found() && 2 * found.grid.corners.size() < whole)  // numbered, so the others are only missed
    look.reason = std::to_string(found.grid.corners.size()) + " of " + std::to_string(whole) + " corners";
  if (!look.found()) return look;
  look.blur_px = scale * blur_of(grey, found.grid, 1.0);
  for (const auto& [cell, corner] : found.grid.corners) {
    const Eigen::Vector2d px = (corner.px.array() + 0.5) * scale - 0.5;
    look.view.corners.push_back({.index = cell.second * board_.cols + cell.first,
                                 .px = px + Eigen::Vector2d(left_px, top_px),
                                 .cov = Eigen::Matrix2d::Identity() * 0.01 * scale * scale});
  }
  std::ranges::sort(look.view.corners, {}, &Corner::index);
  return look;
}

QuickLook QuickLooker::look_for_points(const cv::Mat& photo) {
  QuickLook look;
  cv::Mat small;
  double scale = 1.0;
  constexpr double pixels_of_markers = 2.1e6;
  while (static_cast<double>(photo.total()) / (scale * scale) > pixels_of_markers) scale *= 2.0;
  if (scale > 1.0) cv::resize(photo, small, {}, 1.0 / scale, 1.0 / scale, cv::INTER_AREA);
  BoardDetection found = find_board(scale > 1.0 ? small : photo, board_);
  look.reason = std::move(found.reason);
  look.view = std::move(found.view);
  for (Corner& corner : look.view.corners) corner.px = (corner.px.array() + 0.5) * scale - 0.5;
  return look;
}

QuickLook QuickLooker::look(const cv::Mat& photo) {
  QuickLook look;
  if (photo.empty() || photo.dims != 2) {
    look.reason = "there is no image";
    return look;
  }
  if (board_.kind != BoardKind::chessboard) return look_for_points(photo);
  if (last_) {
    const double room_px =
        std::max(min_roomy_px, 0.25 * std::max(last_->right_px - last_->left_px, last_->bottom_px - last_->top_px));
    const int left = std::clamp(static_cast<int>(last_->left_px - room_px), 0, photo.cols - 1);
    const int top = std::clamp(static_cast<int>(last_->top_px - room_px), 0, photo.rows - 1);
    const int right = std::clamp(static_cast<int>(last_->right_px + room_px), left + 1, photo.cols);
    const int bottom = std::clamp(static_cast<int>(last_->bottom_px + room_px), top + 1, photo.rows);
    look = look_in(photo, left, top, right - left, bottom - top);
  }
  if (!last_ || !look.found()) look = look_in(photo, 0, 0, photo.cols, photo.rows);
  last_.reset();
  if (!look.found()) return look;
  Area area{1e9, 1e9, -1e9, -1e9};
  for (const Corner& corner : look.view.corners) {
    area = {std::min(area.left_px, corner.px.x()), std::min(area.top_px, corner.px.y()),
            std::max(area.right_px, corner.px.x()), std::max(area.bottom_px, corner.px.y())};
  }
  last_ = area;
  return look;
}

}  // namespace alidade
