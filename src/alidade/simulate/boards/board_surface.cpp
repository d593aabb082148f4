#include "alidade/simulate/boards/board_surface.h"

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

/// Weights of the slope, per unit of the coordinate, of the parabola through three nodes, at one of them.
std::array<double, 3> parabola_slope(const double* nodes, std::size_t at) {
  const double a = nodes[0], b = nodes[1], c = nodes[2], x = nodes[at];
  return {(2.0 * x - b - c) / ((a - b) * (a - c)), (2.0 * x - a - c) / ((b - a) * (b - c)),
          (2.0 * x - a - b) / ((c - a) * (c - b))};
}

/// Cubic Hermite weights on uneven nodes, tangents from the parabola through three neighbours: a board that is a
/// parabola is drawn as that. The outer cubics go on for two widths, then a line: the board's own margin is inside.
Weights hermite_weights(const std::vector<double>& nodes, double at) {
  const std::size_t last = nodes.size() - 1;
  const auto above = std::upper_bound(nodes.begin(), nodes.end(), at) - nodes.begin();
  const std::size_t left = std::min(static_cast<std::size_t>(std::max<std::ptrdiff_t>(above - 1, 0)), last - 1);
  Weights weights;
  weights.first = std::min(left > 0 ? left - 1 : 0, last >= 3 ? last - 3 : 0);
  const double width = nodes[left + 1] - nodes[left];
  const double wanted = (at - nodes[left]) / width;
  const double x = std::clamp(wanted, -2.0, 3.0);
  const auto add = [&](std::size_t node, double value, double slope) {
    weights.value[node - weights.first] += value;
    weights.slope[node - weights.first] += slope / width;
  };
  const auto add_tangent = [&](std::size_t node, double value, double slope) {
    if (last < 2) {  // two nodes: a line
      add(1, value, slope);
      add(0, -value, -slope);
      return;
    }
    const std::size_t first = std::min(node > 0 ? node - 1 : 0, last - 2);
    const auto tangent = parabola_slope(&nodes[first], node - first);
    for (std::size_t i = 0; i < 3; ++i) add(first + i, width * tangent[i] * value, width * tangent[i] * slope);
  };
  add(left, 1.0 + x * x * (2.0 * x - 3.0), 6.0 * x * (x - 1.0));
  add(left + 1, x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x));
  add_tangent(left, x * (x - 1.0) * (x - 1.0), (x - 1.0) * (3.0 * x - 1.0));
  add_tangent(left + 1, x * x * (x - 1.0), x * (3.0 * x - 2.0));
  for (std::size_t i = 0; i < weights.value.size(); ++i) weights.value[i] += (wanted - x) * width * weights.slope[i];
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
  fill_gaps(known);
}

void BoardSurface::fill_gaps(const std::vector<bool>& known) {
  for (std::size_t row = 0; row < t_.size(); ++row) {
    std::vector<std::size_t> cols;
    for (std::size_t col = 0; col < s_.size(); ++col) {
      if (known[row * s_.size() + col]) cols.push_back(col);
    }
    const std::size_t order = std::min<std::size_t>(3, cols.size());
    for (std::size_t col = 0; col < s_.size(); ++col) {
      if (known[row * s_.size() + col]) continue;
      const auto after = std::lower_bound(cols.begin(), cols.end(), col) - cols.begin();
      const auto wanted = static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, after - 1));
      const std::size_t first = std::min(wanted, cols.size() - order);
      for (std::size_t i = first; i < first + order; ++i) {
        double weight = 1.0;  // Lagrange's
        for (std::size_t j = first; j < first + order; ++j) {
          if (j != i) weight *= (s_[col] - s_[cols[j]]) / (s_[cols[i]] - s_[cols[j]]);
        }
        nodes_[row * s_.size() + col] += weight * node(cols[i], row);
      }
    }
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
    Eigen::Matrix3d J;  // point(position) = origin + depth · ray
    J << here.along_s, here.along_t, -ray_in_board;
    const Eigen::Vector3d step = J.inverse() * (origin_in_board - here.point);
    if (!step.allFinite()) return std::nullopt;
    place += step.head<2>();
    if (step.head<2>().norm() < tolerance) return step.z() > 0.0 ? std::optional(place) : std::nullopt;
  }
  return std::nullopt;
}

}  // namespace alidade
