#include "alidade/corners/saddle_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "alidade/corners/blurred_edge.h"
#include "alidade/geometry/vector_clones.h"

namespace alidade {
namespace {

constexpr double smoothing_px = 1.1;
constexpr float min_strength = 1.0f;            // a step of 8 grey values with a blur of 1 px has 2
constexpr float relative_strength = 5e-4f;      // of the strongest: one thirtieth of its contrast
constexpr float min_ring_contrast = 2.5f;       // half step, in grey values
constexpr float max_ring_asymmetry = 0.5f;      // of the contrast, mean difference of opposite points
constexpr float max_crossing_bend_rad = 0.45f;  // an edge that enters and leaves in one line
constexpr float min_sector_rad = 0.22f;
constexpr int radius = 4;
constexpr int border = radius + 2;

/// Whole-pixel points of a circle in order of their angle, with that angle.
struct Ring {
  std::vector<std::array<int, 2>> offset;
  std::vector<float> angle_rad;
};

Ring make_ring() {
  struct Point {
    float angle_rad;
    std::array<int, 2> offset;
  };
  std::vector<Point> points;
  for (int y = -radius; y <= radius; ++y) {
    for (int x = -radius; x <= radius; ++x) {
      if (std::lround(std::hypot(x, y)) != radius) continue;
      const float angle = std::atan2(static_cast<float>(y), static_cast<float>(x));
      points.push_back({angle < 0.0f ? angle + 2.0f * std::numbers::pi_v<float> : angle, {x, y}});
    }
  }
  std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.angle_rad < b.angle_rad; });
  Ring ring;
  for (const Point& point : points) {
    ring.offset.push_back(point.offset);
    ring.angle_rad.push_back(point.angle_rad);
  }
  return ring;
}

/// One row of find_strength, but for its first and last pixel.
ALIDADE_VECTOR_CLONES void find_row_strength(const float* up, const float* here, const float* down, int cols,
                                             float* __restrict out) {
  for (int x = 1; x + 1 < cols; ++x) {
    const float xx = here[x - 1] - 2.0f * here[x] + here[x + 1];
    const float yy = up[x] - 2.0f * here[x] + down[x];
    const float xy = 0.25f * (up[x - 1] - up[x + 1] - down[x - 1] + down[x + 1]);
    out[x] = xy * xy - xx * yy;
  }
}

/// -det of the Hessian of the smoothed image.
void find_strength(const cv::Mat& smooth, cv::Mat& strength) {
  strength.create(smooth.size(), CV_32F);
  for (const int edge : {0, smooth.rows - 1}) strength.row(edge).setTo(0.0);
  for (const int edge : {0, smooth.cols - 1}) strength.col(edge).setTo(0.0);
  for (int y = 1; y + 1 < smooth.rows; ++y) {
    find_row_strength(smooth.ptr<float>(y - 1), smooth.ptr<float>(y), smooth.ptr<float>(y + 1), smooth.cols,
                      strength.ptr<float>(y));
  }
}

/// One of eight values is above the threshold.
bool is_any_above(const float* values, float threshold) {
  Float4 one, two;
  std::memcpy(&one, values, sizeof one);
  std::memcpy(&two, values + 4, sizeof two);
  const IntsOf<Float4> above = (one > threshold) | (two > threshold);
  std::array<std::uint64_t, 2> halves;
  std::memcpy(halves.data(), &above, sizeof above);
  return (halves[0] | halves[1]) != 0;
}

bool is_local_maximum(const cv::Mat& strength, int x, int y) {
  const float here = strength.at<float>(y, x);
  for (int dy = -2; dy <= 2; ++dy) {
    const float* row = strength.ptr<float>(y + dy) + x;
    for (int dx = -2; dx <= 2; ++dx) {
      if (row[dx] > here || (row[dx] == here && (dy < 0 || (dy == 0 && dx < 0)))) return false;
    }
  }
  return true;
}

/// Where the gradient vanishes: one Newton step on the smoothed image, at most 1.5 px.
Eigen::Vector2f refined(const cv::Mat& smooth, int x, int y) {
  const auto at = [&](int dx, int dy) { return smooth.at<float>(y + dy, x + dx); };
  const float gx = 0.5f * (at(1, 0) - at(-1, 0)), gy = 0.5f * (at(0, 1) - at(0, -1));
  const float xx = at(-1, 0) - 2.0f * at(0, 0) + at(1, 0), yy = at(0, -1) - 2.0f * at(0, 0) + at(0, 1);
  const float xy = 0.25f * (at(-1, -1) - at(1, -1) - at(-1, 1) + at(1, 1));
  const float det = xx * yy - xy * xy;
  Eigen::Vector2f step(-(yy * gx - xy * gy) / det, -(xx * gy - xy * gx) / det);
  const float length = step.norm();
  if (!(length < 1.5f)) step = Eigen::Vector2f::Zero();
  return Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y)) + step;
}

/// Differences of two angles, in (-π, π].
float turn(float from_rad, float to_rad) { return std::remainder(to_rad - from_rad, 2.0f * std::numbers::pi_v<float>); }

/// The four angles at which the ring crosses `middle`, in order; none unless there are exactly four.
struct Crossings {
  std::array<float, 4> angle_rad;
  bool first_rises;  ///< The sector after the first crossing is bright.
};
std::optional<Crossings> crossings_of(const Ring& ring, const std::vector<float>& grey, float middle) {
  Crossings found{};
  std::size_t count = 0;
  const std::size_t n = grey.size();
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t j = i + 1 < n ? i + 1 : 0;
    if ((grey[i] > middle) == (grey[j] > middle)) continue;
    if (count == 4) return std::nullopt;
    if (count == 0) found.first_rises = grey[j] > middle;
    const float part = (middle - grey[i]) / (grey[j] - grey[i]);
    found.angle_rad[count++] = ring.angle_rad[i] + part * turn(ring.angle_rad[i], ring.angle_rad[j]);
  }
  if (count != 4) return std::nullopt;
  return found;
}

/// Direction [rad] of the line that leaves at `out` and enters at `back`, in [0, π); none where it is curved.
std::optional<float> line_of(float out_rad, float back_rad) {
  constexpr float pi = std::numbers::pi_v<float>;
  const float bend = turn(out_rad, back_rad - pi);
  if (!(std::abs(bend) < max_crossing_bend_rad)) return std::nullopt;
  const float angle = std::fmod(out_rad + 0.5f * bend + 2.0f * pi, pi);
  return angle;
}

std::optional<SaddlePoint> check_ring(const cv::Mat& smooth, const Ring& ring, int x, int y, std::vector<float>& grey) {
  constexpr float pi = std::numbers::pi_v<float>;
  const std::size_t n = ring.offset.size();
  float lowest = 1e9f, highest = -1e9f;
  const float* here = smooth.ptr<float>(y) + x;
  const auto step = static_cast<std::ptrdiff_t>(smooth.step1());
  for (std::size_t i = 0; i < n; ++i) {
    grey[i] = here[ring.offset[i][1] * step + ring.offset[i][0]];
    lowest = std::min(lowest, grey[i]);
    highest = std::max(highest, grey[i]);
  }
  const float contrast = 0.5f * (highest - lowest), middle = 0.5f * (highest + lowest);
  if (!(contrast > min_ring_contrast)) return std::nullopt;
  const auto found = crossings_of(ring, grey, middle);
  if (!found) return std::nullopt;
  float asymmetry = 0.0f;
  for (std::size_t i = 0; i < n / 2; ++i) asymmetry += std::abs(grey[i] - grey[i + n / 2]);
  if (!(asymmetry < max_ring_asymmetry * contrast * static_cast<float>(n / 2))) return std::nullopt;
  const auto one = line_of(found->angle_rad[0], found->angle_rad[2]);
  const auto two = line_of(found->angle_rad[1], found->angle_rad[3]);
  if (!one || !two) return std::nullopt;
  // From the first crossing to the second, the sector is bright if the first one rises.
  float from = found->first_rises ? *one : *two;
  const float other = found->first_rises ? *two : *one;
  float sector = std::fmod(other - from + 2.0f * pi, pi);
  if (!(sector > min_sector_rad && sector < pi - min_sector_rad)) return std::nullopt;
  SaddlePoint point;
  point.angle_rad[0] = from;
  point.angle_rad[1] = from + sector;
  point.middle = middle;
  point.contrast = contrast;
  return point;
}

}  // namespace

std::vector<SaddlePoint> find_saddle_points(const cv::Mat& photo) {
  static const Ring ring = make_ring();
  std::vector<SaddlePoint> points;
  if (photo.rows <= 2 * border || photo.cols <= 2 * border) return points;
  thread_local cv::Mat smooth, strength;  // kept between photos: new pages of memory cost as much as the blur
  cv::GaussianBlur(photo, smooth, cv::Size(7, 7), smoothing_px, smoothing_px, cv::BORDER_REPLICATE);
  find_strength(smooth, strength);
  double strongest = 0.0;
  cv::minMaxLoc(strength, nullptr, &strongest);
  const float threshold = std::max(min_strength, relative_strength * static_cast<float>(strongest));
  std::vector<float> grey(ring.offset.size());
  for (int y = border; y < photo.rows - border; ++y) {
    const float* row = strength.ptr<float>(y);
    for (int x = border; x < photo.cols - border; ++x) {
      while (x + 8 <= photo.cols - border && !is_any_above(row + x, threshold)) x += 8;  // most of a photo is smooth
      if (x >= photo.cols - border) break;
      if (!(row[x] > threshold) || row[x] < row[x - 1] || row[x] < row[x + 1]) continue;
      if (!is_local_maximum(strength, x, y)) continue;
      auto point = check_ring(smooth, ring, x, y, grey);
      if (!point) continue;
      point->px = refined(smooth, x, y);
      point->strength = row[x];
      points.push_back(*point);
    }
  }
  return points;
}

}  // namespace alidade
