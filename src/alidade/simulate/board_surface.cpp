#include "alidade/simulate/board_surface.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>

namespace alidade {
namespace {

/// Weights of the nodes around one coordinate, and their derivatives: nodes first … first + 3.
struct Weights {
  std::size_t first = 0;
  std::array<double, 4> value{}, slope{};
};

/// Cubic Hermite weights on uneven nodes, tangents from the neighbours' difference; beyond the ends the line goes on.
Weights hermite_weights(const std::vector<double>& nodes, double at) {
  const std::size_t last = nodes.size() - 1;
  const auto above = std::upper_bound(nodes.begin(), nodes.end(), at) - nodes.begin();
  const std::size_t left = std::min(static_cast<std::size_t>(std::max<std::ptrdiff_t>(above - 1, 0)), last - 1);
  Weights weights;
  weights.first = std::min(left > 0 ? left - 1 : 0, last >= 3 ? last - 3 : 0);
  const double width = nodes[left + 1] - nodes[left];
  const double x = (at - nodes[left]) / width;
  const auto add = [&](std::size_t node, double value, double slope) {
    weights.value[node - weights.first] += value;
    weights.slope[node - weights.first] += slope / width;
  };
  const auto add_tangent = [&](std::size_t node, double value, double slope) {
    const std::size_t before = node > 0 ? node - 1 : node, after = std::min(node + 1, last);
    const double per_width = width / (nodes[after] - nodes[before]);
    add(after, per_width * value, per_width * slope);
    add(before, -per_width * value, -per_width * slope);
  };
  if (x < 0.0 || x > 1.0) {
    const std::size_t end = x < 0.0 ? left : left + 1;
    add(end, 1.0, 0.0);
    add_tangent(end, x < 0.0 ? x : x - 1.0, 1.0);
    return weights;
  }
  add(left, 1.0 + x * x * (2.0 * x - 3.0), 6.0 * x * (x - 1.0));
  add(left + 1, x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x));
  add_tangent(left, x * (x - 1.0) * (x - 1.0), (x - 1.0) * (3.0 * x - 1.0));
  add_tangent(left + 1, x * x * (x - 1.0), x * (3.0 * x - 2.0));
  return weights;
}

std::vector<double> distinct(std::vector<double> values, double tiny) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end(), [tiny](double a, double b) { return b - a < tiny; }),
               values.end());
  return values;
}

std::size_t nearest(const std::vector<double>& values, double at) {
  const auto right = std::lower_bound(values.begin(), values.end(), at) - values.begin();
  const auto i = static_cast<std::size_t>(right);
  if (i == 0) return 0;
  if (i == values.size()) return i - 1;
  return at - values[i - 1] < values[i] - at ? i - 1 : i;
}

}  // namespace

BoardSurface::BoardSurface(const Board& board, std::span<const Eigen::Vector3d> true_points) {
  const std::vector<Eigen::Vector3d> nominal = alidade::points_in_board(board);
  std::vector<double> s, t;
  for (const Eigen::Vector3d& point : nominal) {
    s.push_back(point.x());
    t.push_back(point.y());
  }
  s_ = distinct(std::move(s), 1e-6 * board.square_m);
  t_ = distinct(std::move(t), 1e-6 * board.square_m);
  nodes_.assign(s_.size() * t_.size(), Eigen::Vector3d::Zero());
  std::vector<bool> known(nodes_.size(), false);
  for (std::size_t i = 0; i < nominal.size(); ++i) {
    const std::size_t k = nearest(t_, nominal[i].y()) * s_.size() + nearest(s_, nominal[i].x());
    nodes_[k] = true_points[i] - nominal[i];
    known[k] = true;
    is_flat_ = is_flat_ && nodes_[k].norm() < 1e-12;
  }
  // A staggered grid has no point at every other node: the mean of the neighbours in its row.
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    if (known[k]) continue;
    const std::size_t col = k % s_.size();
    const bool has_left = col > 0, has_right = col + 1 < s_.size();
    if (has_left) nodes_[k] += (has_right ? 0.5 : 1.0) * nodes_[k - 1];
    if (has_right) nodes_[k] += (has_left ? 0.5 : 1.0) * nodes_[k + 1];
  }
}

BoardSurface::Patch BoardSurface::patch(const Eigen::Vector2d& place) const {
  Patch patch{{place.x(), place.y(), 0.0}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY()};
  if (is_flat_) return patch;
  const Weights s = hermite_weights(s_, place.x()), t = hermite_weights(t_, place.y());
  const std::size_t cols = std::min<std::size_t>(4, s_.size()), rows = std::min<std::size_t>(4, t_.size());
  for (std::size_t j = 0; j < rows; ++j) {
    Eigen::Vector3d value = Eigen::Vector3d::Zero(), slope = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < cols; ++i) {
      value += s.value[i] * node(s.first + i, t.first + j);
      slope += s.slope[i] * node(s.first + i, t.first + j);
    }
    patch.point += t.value[j] * value;
    patch.along_s += t.value[j] * slope;
    patch.along_t += t.slope[j] * value;
  }
  return patch;
}

std::optional<Eigen::Vector2d> BoardSurface::intersect(const Eigen::Vector3d& origin_in_board,
                                                       const Eigen::Vector3d& ray_in_board,
                                                       const Eigen::Vector2d& start) const {
  Eigen::Vector2d place = start;
  constexpr int max_iterations = 8;  // quadratic; 2 or 3 steps are typical
  const double tolerance = 1e-7 * (s_[1] - s_[0]);
  for (int i = 0; i < max_iterations; ++i) {
    const Patch here = patch(place);
    Eigen::Matrix3d J;  // point(place) = origin + depth · ray
    J << here.along_s, here.along_t, -ray_in_board;
    const Eigen::Vector3d step = J.inverse() * (origin_in_board - here.point);
    if (!step.allFinite()) return std::nullopt;
    place += step.head<2>();
    if (step.head<2>().norm() < tolerance) return step.z() > 0.0 ? std::optional(place) : std::nullopt;
  }
  return std::nullopt;
}

}  // namespace alidade
