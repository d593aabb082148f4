#include "alidade/corners/corner_window.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>

#include "alidade/geometry/vector_clones.h"

namespace alidade {
namespace {

constexpr double small_square_px = 10.0;  // in smaller squares every pixel counts: the window is the whole square

/// Columns of row y, relative to the origin, that lie in the parallelogram |a|, |b| < half, (a, b) = inverse · (p − c).
std::pair<int, int> span_of_row(const Eigen::Matrix2d& inverse, const Eigen::Vector2d& half,
                                const Eigen::Vector2d& center, double y) {
  double x_min = -1e6, x_max = 1e6;
  for (int k = 0; k < 2; ++k) {
    const double slope = inverse(k, 0);
    const double at_zero = inverse(k, 1) * (y - center.y()) - slope * center.x();
    if (std::abs(slope) < 1e-9) {
      if (!(std::abs(at_zero) < half[k])) return {0, -1};
      continue;
    }
    const double one = (-half[k] - at_zero) / slope, other = (half[k] - at_zero) / slope;
    x_min = std::max(x_min, std::min(one, other));
    x_max = std::min(x_max, std::max(one, other));
  }
  return {static_cast<int>(std::ceil(x_min)), static_cast<int>(std::floor(x_max))};
}

/// Signed distance [px] to an edge through `center`, curved as far as the initial guess knows.
struct StartEdge {
  float cosine, sine, half_bend, offset_x, offset_y;

  StartEdge(const Eigen::Vector2d& along, double bend, const Eigen::Vector2d& center)
      : cosine(static_cast<float>(along.normalized().x())),
        sine(static_cast<float>(along.normalized().y())),
        half_bend(static_cast<float>(0.5 * bend)),
        offset_x(static_cast<float>(center.x())),
        offset_y(static_cast<float>(center.y())) {}

  [[nodiscard]] float distance(float x, float y) const {
    const float dx = x - offset_x, dy = y - offset_y, along = cosine * dx + sine * dy;
    return cosine * dy - sine * dx - half_bend * along * along;
  }
};

/// Distances of the pixels (from + i, y) to the two edges.
ALIDADE_VECTOR_CLONES void row_distances(StartEdge one, StartEdge two, int from, int y, std::size_t count,
                                         float* __restrict d1, float* __restrict d2) {
  const auto at_y = static_cast<float>(y);
  for (std::size_t i = 0; i < count; ++i) {
    const auto at_x = static_cast<float>(from + static_cast<int>(i));
    d1[i] = one.distance(at_x, at_y);
    d2[i] = two.distance(at_x, at_y);
  }
}

/// A row's distances to the edges.
struct RowDistances {
  std::vector<float> to_one, to_two;

  void take(const StartEdge& one, const StartEdge& two, int from, int y, std::size_t count) {
    if (to_one.size() < count) {
      to_one.resize(count);
      to_two.resize(count);
    }
    row_distances(one, two, from, y, count, to_one.data(), to_two.data());
  }
};

void add_far(FarPixels& far, double grey) {
  far.count += 1.0;
  far.sum += grey;
  far.sum_of_squares += grey * grey;
}

/// The parallelogram in the pixels of `origin`: |a|, |b| < half with (a, b) = inverse · (p − center).
struct Parallelogram {
  Eigen::Matrix2d inverse;
  Eigen::Vector2d half, center;
  double reach_y;  ///< Half its height.
};

Parallelogram parallelogram_of(const CornerStart& start, const CornerFitConfig& config, const Eigen::Vector2d& origin) {
  Eigen::Matrix2d square;
  square << start.along_cols, start.along_rows;
  const Eigen::Vector2d lengths = square.colwise().norm();
  const double window = lengths.minCoeff() < small_square_px ? 0.5 : config.window;
  const Eigen::Vector2d half = (config.max_half_window_px * lengths.cwiseInverse()).cwiseMin(window);
  return {square.inverse(), half, start.px - origin,
          std::abs(square(1, 0)) * half[0] + std::abs(square(1, 1)) * half[1]};
}

void make_room(std::size_t most, CornerWindow& window) {
  for (std::vector<float>* values : {&window.x, &window.y, &window.grey})
    if (values->size() < most) values->resize(2 * most);
}

}  // namespace

CornerWindow gather_window(const cv::Mat& photo, const CornerStart& start, const CornerFitConfig& config,
                           double near_px) {
  const int origin_x = static_cast<int>(std::lround(start.px.x()));
  const int origin_y = static_cast<int>(std::lround(start.px.y()));
  CornerWindow window;
  window.origin = {origin_x, origin_y};
  window.near_px = near_px;
  const Parallelogram area = parallelogram_of(start, config, window.origin);
  const StartEdge one(start.along_cols, start.bend_cols, area.center);
  const StartEdge two(start.along_rows, start.bend_rows, area.center);
  const auto near = static_cast<float>(near_px);
  const int y_min = std::max(-origin_y, static_cast<int>(std::ceil(area.center.y() - area.reach_y)));
  const int y_max = std::min(photo.rows - 1 - origin_y, static_cast<int>(std::floor(area.center.y() + area.reach_y)));
  std::size_t count = 0;
  RowDistances distances;
  for (int y = y_min; y <= y_max; ++y) {
    const auto [first, last] = span_of_row(area.inverse, area.half, area.center, y);
    const float* row = photo.ptr<float>(origin_y + y) + origin_x;
    const int from = std::max(first, -origin_x), to = std::min(last, photo.cols - 1 - origin_x);
    if (to < from) continue;
    const auto num_in_row = static_cast<std::size_t>(to - from + 1), most = count + num_in_row;
    make_room(most, window);
    distances.take(one, two, from, y, num_in_row);
    const std::vector<float>&to_one = distances.to_one, &to_two = distances.to_two;
    for (std::size_t i = 0; i < num_in_row; ++i) {
      const int x = from + static_cast<int>(i);
      if (std::abs(to_one[i]) > near && std::abs(to_two[i]) > near) {
        add_far(window.far[to_one[i] * to_two[i] > 0.0f ? 1 : 0], row[x]);
        continue;
      }
      window.x[count] = static_cast<float>(x);
      window.y[count] = static_cast<float>(y);
      window.grey[count] = row[x];
      ++count;
    }
  }
  const std::size_t groups = count / 4;
  for (std::vector<float>* values : {&window.x, &window.y, &window.grey}) values->resize(4 * groups);
  return window;
}

}  // namespace alidade
