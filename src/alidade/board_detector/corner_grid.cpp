#include "alidade/board_detector/corner_grid.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>

namespace alidade {
namespace {

constexpr float bucket_px = 16.0f;
constexpr float min_step_px = 4.0f, max_step_px = 130.0f;  // larger squares are found at half the size
constexpr float min_neighbour_cosine = 0.96f;              // 16° between an edge and the way to the neighbour
constexpr float max_line_angle_rad = 0.5f;                 // between the same edge at two corners
constexpr double max_miss = 0.3;                           // from the prediction, in squares
constexpr float max_contrast_ratio = 4.0f;                 // among the corners of a first square
constexpr float min_square_contrast = 0.25f;               // of its weakest corner's, for it and its neighbours
constexpr std::size_t max_seeds = 2000;                    // the strongest: bounds the time spent on a texture
constexpr std::size_t min_corners_of_grid = 6;
constexpr std::array<GridCell, 4> sides{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

/// Saddle points by position: the points of square bucket k are order_[first_[k]] … order_[first_[k + 1] - 1].
class PointIndex {
 public:
  explicit PointIndex(std::span<const SaddlePoint> points) : points_(points) {
    for (const SaddlePoint& point : points) {
      cols_ = std::max(cols_, bucket(point.px.x()) + 1);
      rows_ = std::max(rows_, bucket(point.px.y()) + 1);
    }
    first_.assign(static_cast<std::size_t>(cols_ * rows_) + 1, 0);
    for (const SaddlePoint& point : points) ++first_[place(point) + 1];
    for (std::size_t k = 1; k < first_.size(); ++k) first_[k] += first_[k - 1];
    order_.resize(points.size());
    std::vector<std::size_t> next = first_;
    for (std::size_t k = 0; k < points.size(); ++k) order_[next[place(points[k])]++] = k;
  }

  template <class Visit>
  void visit_around(const Eigen::Vector2f& px, float radius_px, const Visit& visit) const {
    const int x_min = std::max(bucket(px.x() - radius_px), 0);
    const int x_max = std::min(bucket(px.x() + radius_px), cols_ - 1);
    if (x_min > x_max) return;
    for (int y = std::max(bucket(px.y() - radius_px), 0); y <= std::min(bucket(px.y() + radius_px), rows_ - 1); ++y) {
      const auto from = static_cast<std::size_t>(y * cols_ + x_min), to = static_cast<std::size_t>(y * cols_ + x_max);
      for (std::size_t at = first_[from]; at < first_[to + 1]; ++at) {
        const std::size_t k = order_[at];
        if ((points_[k].px - px).squaredNorm() <= radius_px * radius_px) visit(k);
      }
    }
  }

 private:
  static int bucket(float at) { return static_cast<int>(std::floor(std::clamp(at, -1e6f, 1e6f) / bucket_px)); }
  [[nodiscard]] std::size_t place(const SaddlePoint& point) const {
    return static_cast<std::size_t>(bucket(point.px.y()) * cols_ + bucket(point.px.x()));
  }

  std::span<const SaddlePoint> points_;
  int cols_ = 0, rows_ = 0;
  std::vector<std::size_t> first_, order_;
};

/// Angle between two undirected lines, in [0, π/2].
float line_angle(float a_rad, float b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, std::numbers::pi_v<float>));
}

float angle_of(const Eigen::Vector2d& step) {
  return std::atan2(static_cast<float>(step.y()), static_cast<float>(step.x()));
}

/// Neighbouring corners see the same edges with the colours exchanged: type 0 is the edge that starts a bright sector.
bool has_lines(const SaddlePoint& point, int type_along_i, float angle_i_rad, float angle_j_rad) {
  return line_angle(point.angle_rad[type_along_i], angle_i_rad) < max_line_angle_rad &&
         line_angle(point.angle_rad[1 - type_along_i], angle_j_rad) < max_line_angle_rad;
}

int type_along_i(int i, int j) { return (i + j) & 1; }

class Grower {
 public:
  Grower(const cv::Mat& image, std::span<const SaddlePoint> points)
      : image_(image), points_(points), index_(points), used_(points.size(), 0) {}

  std::vector<CornerGrid> run() {
    std::vector<std::size_t> order(points_.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return points_[a].strength > points_[b].strength; });
    if (order.size() > max_seeds) order.resize(max_seeds);
    std::vector<CornerGrid> grids;
    for (const std::size_t seed : order) {
      if (used_[seed]) continue;
      CornerGrid grid = first_square(seed);
      if (grid.corners.empty()) continue;
      grow(grid);
      if (grid.corners.size() >= min_corners_of_grid) {
        grids.push_back(std::move(grid));
      } else {  // its points may belong to another
        for (const std::size_t point : taken_) used_[point] = 0;
      }
      taken_.clear();
    }
    std::stable_sort(grids.begin(), grids.end(),
                     [](const CornerGrid& a, const CornerGrid& b) { return a.corners.size() > b.corners.size(); });
    return grids;
  }

 private:
  /// The nearest unused point along ±(line `type` of the seed) that sees the same lines with colours exchanged.
  std::optional<std::size_t> neighbour(std::size_t seed, int type, float sign) const {
    const SaddlePoint& from = points_[seed];
    const Eigen::Vector2f direction =
        sign * Eigen::Vector2f(std::cos(from.angle_rad[type]), std::sin(from.angle_rad[type]));
    std::optional<std::size_t> best;
    float best_px = max_step_px;
    index_.visit_around(from.px, max_step_px, [&](std::size_t k) {
      if (used_[k] || k == seed) return;
      const Eigen::Vector2f way = points_[k].px - from.px;
      const float ahead = direction.dot(way);
      if (!(ahead > 0.0f)) return;
      const float length = way.norm();
      if (!(length < best_px && length > min_step_px) || ahead < min_neighbour_cosine * length) return;
      if (!has_lines(points_[k], 1, from.angle_rad[0], from.angle_rad[1])) return;
      best_px = length;
      best = k;
    });
    return best;
  }

  /// A square of four corners around the seed, in any of its four quadrants; empty where there is none.
  CornerGrid first_square(std::size_t seed) {
    for (const float sign_i : {1.0f, -1.0f}) {
      const auto along_i = neighbour(seed, 0, sign_i);
      if (!along_i) continue;
      for (const float sign_j : {1.0f, -1.0f}) {
        const auto along_j = neighbour(seed, 1, sign_j);
        if (!along_j) continue;
        const Eigen::Vector2d origin = points_[seed].px.cast<double>();
        GridCorner far;
        far.step_i = sign_i * (points_[*along_i].px.cast<double>() - origin);
        far.step_j = sign_j * (points_[*along_j].px.cast<double>() - origin);
        far.px = origin + sign_i * far.step_i + sign_j * far.step_j;
        const auto opposite = nearest(far, 0);
        if (!opposite) continue;
        // Seen from the seed, the sectors between +i and +j and between -i and -j are bright.
        if (!has_checkered_surroundings({seed, *along_i, *along_j, *opposite}, far, sign_i == sign_j)) continue;
        const int i = static_cast<int>(sign_i), j = static_cast<int>(sign_j);
        CornerGrid grid;
        take(grid, {0, 0}, seed, far);
        take(grid, {i, 0}, *along_i, far);
        take(grid, {0, j}, *along_j, far);
        take(grid, {i, j}, *opposite, far);
        return grid;
      }
    }
    return {};
  }

  /// The square between four corners and its eight neighbours alternate: chance saddles of a texture seldom do.
  [[nodiscard]] bool has_checkered_surroundings(const std::array<std::size_t, 4>& corners, const GridCorner& steps,
                                                bool center_is_bright) const {
    Eigen::Vector2f center = Eigen::Vector2f::Zero();
    float middle = 0.0f, weakest = points_[corners[0]].contrast, strongest = weakest;
    for (const std::size_t k : corners) {
      center += 0.25f * points_[k].px;
      middle += 0.25f * points_[k].middle;
      weakest = std::min(weakest, points_[k].contrast);
      strongest = std::max(strongest, points_[k].contrast);
    }
    if (strongest > max_contrast_ratio * weakest) return false;
    const Eigen::Vector2f step_i = steps.step_i.cast<float>(), step_j = steps.step_j.cast<float>();
    for (int b = -1; b <= 1; ++b) {
      for (int a = -1; a <= 1; ++a) {
        const Eigen::Vector2f px = center + static_cast<float>(a) * step_i + static_cast<float>(b) * step_j;
        const int x = static_cast<int>(std::lround(px.x())), y = static_cast<int>(std::lround(px.y()));
        if (x < 0 || y < 0 || x >= image_.cols || y >= image_.rows) continue;
        const float above = image_.at<float>(y, x) - middle;
        const bool should_be_bright = center_is_bright == ((a + b) % 2 == 0);
        if (!((should_be_bright ? above : -above) > min_square_contrast * weakest)) return false;
      }
    }
    return true;
  }

  /// The unused point nearest to a prediction, within `max_miss` of a square in both directions.
  std::optional<std::size_t> nearest(const GridCorner& predicted, int type) const {
    Eigen::Matrix2d square;
    square << predicted.step_i, predicted.step_j;
    const Eigen::Matrix2d inverse = square.inverse();
    const double reach = max_miss * (predicted.step_i.norm() + predicted.step_j.norm());
    const float angle_i = angle_of(predicted.step_i), angle_j = angle_of(predicted.step_j);
    std::optional<std::size_t> best;
    double best_miss = max_miss;
    index_.visit_around(predicted.px.cast<float>(), static_cast<float>(reach), [&](std::size_t k) {
      if (used_[k] || !has_lines(points_[k], type, angle_i, angle_j)) return;
      const double miss = (inverse * (points_[k].px.cast<double>() - predicted.px)).lpNorm<Eigen::Infinity>();
      if (!(miss < best_miss)) return;
      best_miss = miss;
      best = k;
    });
    return best;
  }

  /// Every square that the new corner completes has its colour, and its corners are about as bright and as strong.
  [[nodiscard]] bool fits_colours(const CornerGrid& grid, const GridCell& cell, std::size_t point) const {
    const SaddlePoint& added = points_[point];
    for (const int di : {-1, 1}) {
      for (const int dj : {-1, 1}) {
        const GridCorner *one = grid.at(cell.first + di, cell.second), *two = grid.at(cell.first, cell.second + dj);
        const GridCorner* far = grid.at(cell.first + di, cell.second + dj);
        if (!one || !two || !far) continue;
        const float weakest = std::min({added.contrast, one->contrast, two->contrast, far->contrast});
        const float strongest = std::max({added.contrast, one->contrast, two->contrast, far->contrast});
        if (strongest > max_contrast_ratio * weakest) return false;
        const float middle = 0.25f * (added.middle + one->middle + two->middle + far->middle);
        const Eigen::Vector2d center = 0.25 * (added.px.cast<double>() + one->px + two->px + far->px);
        const auto x = static_cast<int>(std::lround(center.x())), y = static_cast<int>(std::lround(center.y()));
        const bool is_bright = (cell.first + cell.second + (di < 0 ? 1 : 0) + (dj < 0 ? 1 : 0)) % 2 == 0;
        const float above = image_.at<float>(y, x) - middle;
        if (!((is_bright ? above : -above) > min_square_contrast * weakest)) return false;
      }
    }
    return true;
  }

  void take(CornerGrid& grid, const GridCell& cell, std::size_t point, const GridCorner& steps) {
    GridCorner corner = steps;
    corner.px = points_[point].px.cast<double>();
    corner.middle = points_[point].middle;
    corner.contrast = points_[point].contrast;
    grid.corners[cell] = corner;
    used_[point] = 1;
    taken_.push_back(point);
  }

  void grow(CornerGrid& grid) {
    bool grown = true;
    while (grown) {
      grown = false;
      std::vector<GridCell> cells;
      for (const auto& [cell, corner] : grid.corners) cells.push_back(cell);
      for (const auto& [i, j] : cells) {
        for (const auto& [di, dj] : sides) {
          if (grid.at(i + di, j + dj)) continue;
          const auto predicted = predict_corner(grid, i + di, j + dj);
          if (!predicted) continue;
          const auto point = nearest(*predicted, type_along_i(i + di, j + dj));
          if (!point || !fits_colours(grid, {i + di, j + dj}, *point)) continue;
          take(grid, {i + di, j + dj}, *point, *predicted);
          grown = true;
        }
      }
    }
  }

  const cv::Mat& image_;
  std::span<const SaddlePoint> points_;
  PointIndex index_;
  std::vector<char> used_;
  std::vector<std::size_t> taken_;  ///< By the grid that grows.
};

/// Mean of the steps along (di, dj) between the corners nearest to (i, j); none if there are none.
std::optional<Eigen::Vector2d> local_step(const CornerGrid& grid, int i, int j, int di, int dj) {
  Eigen::Vector2d total = Eigen::Vector2d::Zero();
  int count = 0;
  for (int a = -2; a <= 1; ++a) {
    for (int b = -1; b <= 1; ++b) {
      const int from_i = i + a * di + b * dj, from_j = j + a * dj + b * di;
      const GridCorner *from = grid.at(from_i, from_j), *to = grid.at(from_i + di, from_j + dj);
      if (!from || !to) continue;
      total += to->px - from->px;
      ++count;
    }
  }
  if (count == 0) return std::nullopt;
  return total / count;
}

}  // namespace

GridExtent extent_of(const CornerGrid& grid) {
  constexpr int far = std::numeric_limits<int>::max();
  GridExtent extent{far, -far, far, -far};
  for (const auto& [cell, corner] : grid.corners) {
    extent.i_min = std::min(extent.i_min, cell.first);
    extent.i_max = std::max(extent.i_max, cell.first);
    extent.j_min = std::min(extent.j_min, cell.second);
    extent.j_max = std::max(extent.j_max, cell.second);
  }
  return grid.corners.empty() ? GridExtent{} : extent;
}

std::optional<GridCorner> predict_corner(const CornerGrid& grid, int i, int j) {
  Eigen::Vector2d total = Eigen::Vector2d::Zero();
  double weight = 0.0;
  for (const auto& [di, dj] : sides) {
    const GridCorner *one = grid.at(i - di, j - dj), *two = grid.at(i - 2 * di, j - 2 * dj);
    const GridCorner* three = grid.at(i - 3 * di, j - 3 * dj);
    if (one && two) {
      total +=
          three ? Eigen::Vector2d(3.0 * one->px - 3.0 * two->px + three->px) : Eigen::Vector2d(2.0 * one->px - two->px);
      weight += 1.0;
    }
    const GridCorner *left = grid.at(i - dj, j + di), *both = grid.at(i - di - dj, j - dj + di);  // the square beside
    if (one && left && both) {
      total += one->px + left->px - both->px;
      weight += 1.0;
    }
  }
  if (weight == 0.0) return std::nullopt;
  const auto step_i = local_step(grid, i, j, 1, 0), step_j = local_step(grid, i, j, 0, 1);
  if (!step_i || !step_j) return std::nullopt;
  return GridCorner{total / weight, *step_i, *step_j};
}

std::vector<CornerGrid> grow_grids(const cv::Mat& image, std::span<const SaddlePoint> points) {
  return Grower(image, points).run();
}

}  // namespace alidade
