#include "alidade/calibrate/far_corners.h"
#include "alidade/estimation/median.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

/// Distance of each point from the median of each coordinate, in the median of these distances.
template <class Point>
std::vector<double> relative_distances(std::size_t count, const Point& point) {
  std::vector<double> x, y, distances;
  x.reserve(count);
  y.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    x.push_back(point(i).x());
    y.push_back(point(i).y());
  }
  const Eigen::Vector2d centre(median_of(x), median_of(y));
  distances.reserve(count);
  for (std::size_t i = 0; i < count; ++i) distances.push_back((point(i) - centre).norm());
  std::vector<double> sorted = distances;
  const double unit = std::max(median_of(sorted), 1e-300);
  for (double& distance : distances) distance /= unit;
  return distances;
}

/// Whether there may be one; costs next to nothing. A grid's farthest corner is twice as far from the mean as the mean
/// distance; with one of six corners at infinity, three times.
bool may_have_far_corners(const std::vector<Corner>& corners) {
  constexpr double min_ratio = 2.4;
  const auto count = static_cast<double>(corners.size());
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Corner& corner : corners) mean += corner.px / count;
  double sum = 0.0, farthest = 0.0;
  for (const Corner& corner : corners) {
    const double distance = (corner.px - mean).norm();
    sum += distance;
    farthest = std::max(farthest, distance);
  }
  return !std::isfinite(sum) || farthest * count > min_ratio * sum;
}

}  // namespace

std::vector<bool> far_corners(const BoardView& view, const std::vector<Eigen::Vector3d>& board_points) {
  const auto& corners = view.corners;
  if (corners.size() < 6 || !may_have_far_corners(corners)) return {};
  constexpr double max_stretched = 8.0;  // how far perspective and lens may move one corner from the rest
  const auto in_image = relative_distances(corners.size(), [&](std::size_t i) { return corners[i].px; });
  if (*std::max_element(in_image.begin(), in_image.end()) <= max_stretched) return {};
  const auto on_board = relative_distances(corners.size(), [&](std::size_t i) -> Eigen::Vector2d {
    return board_points[static_cast<std::size_t>(corners[i].index)].head<2>();
  });
  std::vector<bool> far(corners.size());
  for (std::size_t i = 0; i < far.size(); ++i) far[i] = in_image[i] > max_stretched * std::max(1.0, on_board[i]);
  return std::find(far.begin(), far.end(), true) == far.end() ? std::vector<bool>{} : far;
}

BoardView without(const BoardView& view, const std::vector<bool>& far) {
  BoardView rest{view.photo, {}};
  for (std::size_t i = 0; i < far.size(); ++i) {
    if (!far[i]) rest.corners.push_back(view.corners[i]);
  }
  return rest;
}

}  // namespace alidade
