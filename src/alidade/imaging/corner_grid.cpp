#include "alidade/imaging/corner_grid.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <unordered_map>

namespace alidade {
namespace {

constexpr float bucket_px = 24.0f;
constexpr float min_step_px = 4.0f, max_step_px = 130.0f;  // larger squares are found at half the size
constexpr float max_neighbour_angle_rad = 0.28f;           // between an edge and the way to the neighbour
constexpr float max_line_angle_rad = 0.5f;                 // between the same edge at two corners
constexpr double max_miss = 0.3;                           // from the prediction, in squares
constexpr std::size_t min_corners = 6;
constexpr std::array<GridCell, 4> sides{{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

/// Saddle points by place.
class PointIndex {
 public:
  explicit PointIndex(std::span<const SaddlePoint> points) : points_(points) {
    for (std::size_t k = 0; k < points.size(); ++k) {
      buckets_[key(bucket(points[k].px.x()), bucket(points[k].px.y()))].push_back(k);
    }
  }

  template <class Visit>
  void visit_around(const Eigen::Vector2f& px, float radius_px, const Visit& visit) const {
    for (int y = bucket(px.y() - radius_px); y <= bucket(px.y() + radius_px); ++y) {
      for (int x = bucket(px.x() - radius_px); x <= bucket(px.x() + radius_px); ++x) {
        const auto found = buckets_.find(key(x, y));
        if (found == buckets_.end()) continue;
        for (const std::size_t k : found->second) {
          if ((points_[k].px - px).squaredNorm() <= radius_px * radius_px) visit(k);
        }
      }
    }
  }

 private:
  static int bucket(float at) { return static_cast<int>(std::floor(at / bucket_px)); }
  static std::int64_t key(int x, int y) { return (static_cast<std::int64_t>(y) << 32) ^ static_cast<std::uint32_t>(x); }

  std::span<const SaddlePoint> points_;
  std::unordered_map<std::int64_t, std::vector<std::size_t>> buckets_;
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
  explicit Grower(std::span<const SaddlePoint> points) : points_(points), index_(points), used_(points.size(), 0) {}

  std::vector<CornerGrid> run() {
    std::vector<std::size_t> order(points_.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return points_[a].strength > points_[b].strength; });
    std::vector<CornerGrid> grids;
    for (const std::size_t seed : order) {
      if (used_[seed]) continue;
      CornerGrid grid = first_square(seed);
      if (grid.corners.empty()) continue;
      grow(grid);
      if (grid.corners.size() >= min_corners) {
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
      const float length = way.norm();
      if (!(length < best_px && length > min_step_px)) return;
      if (direction.dot(way) < std::cos(max_neighbour_angle_rad) * length) return;
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

  void take(CornerGrid& grid, const GridCell& cell, std::size_t point, const GridCorner& steps) {
    GridCorner corner = steps;
    corner.px = points_[point].px.cast<double>();
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
          if (!point) continue;
          take(grid, {i + di, j + dj}, *point, *predicted);
          grown = true;
        }
      }
    }
  }

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

std::vector<CornerGrid> grow_grids(std::span<const SaddlePoint> points) { return Grower(points).run(); }

}  // namespace alidade
