#include "alidade/imaging/rectangles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Quad = std::array<Eigen::Vector2d, 4>;

constexpr double min_side_px = 12.0;
constexpr double min_contrast = 20.0;  // grey values; a printed rectangle has five times that
constexpr double max_edge_px = 0.6;    // RMS of an edge from straight: 0.1 of print, 1 and more of chance

double grey_at(const cv::Mat& image, const Eigen::Vector2d& px) {
  const int u = static_cast<int>(std::floor(px.x())), v = static_cast<int>(std::floor(px.y()));
  if (u < 0 || v < 0 || u + 1 >= image.cols || v + 1 >= image.rows) return std::nan("");
  const double a = px.x() - u, b = px.y() - v;
  const std::uint8_t* const g = image.ptr<std::uint8_t>(v) + u;
  const std::uint8_t* const h = image.ptr<std::uint8_t>(v + 1) + u;
  return (1 - b) * ((1 - a) * g[0] + a * g[1]) + b * ((1 - a) * h[0] + a * h[1]);
}

/// Clockwise in the image (y down), beginning at the top left.
Quad ordered(Quad quad) {
  double area = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d &p = quad[i], &q = quad[(i + 1) % 4];
    area += p.x() * q.y() - q.x() * p.y();
  }
  if (area < 0.0) std::swap(quad[1], quad[3]);
  const auto first = std::ranges::min_element(quad, {}, [](const Eigen::Vector2d& p) { return p.sum(); });
  std::rotate(quad.begin(), first, quad.end());
  return quad;
}

/// Outlines with four corners, at many grey levels.
std::vector<Quad> outlines(const cv::Mat& grey) {
  std::vector<Quad> quads;
  constexpr int num_levels = 14;
  for (int level = 1; level <= num_levels; ++level) {
    cv::Mat mask;
    cv::threshold(grey, mask, 255.0 * level / (num_levels + 1), 255, cv::THRESH_BINARY);
    std::vector<std::vector<cv::Point>> contours;
    cv::findContours(mask, contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
    for (const auto& contour : contours) {
      if (static_cast<double>(contour.size()) < 4.0 * min_side_px) continue;
      std::vector<cv::Point> corners;
      cv::approxPolyDP(contour, corners, 0.03 * static_cast<double>(contour.size()), true);
      if (corners.size() != 4 || !cv::isContourConvex(corners)) continue;
      Quad quad;
      bool is_inside = true, is_large = true;
      for (std::size_t i = 0; i < 4; ++i) quad[i] = {corners[i].x, corners[i].y};
      for (std::size_t i = 0; i < 4; ++i) {
        is_large = is_large && (quad[i] - quad[(i + 1) % 4]).norm() >= min_side_px;
        is_inside = is_inside && quad[i].minCoeff() > 2.0 && quad[i].x() < grey.cols - 3 && quad[i].y() < grey.rows - 3;
      }
      if (!is_inside || !is_large) continue;
      quad = ordered(quad);
      const bool is_new = std::ranges::none_of(quads, [&](const Quad& other) {
        double most = 0.0;
        for (std::size_t i = 0; i < 4; ++i) most = std::max(most, (other[i] - quad[i]).norm());
        return most < 2.5;
      });
      if (is_new) quads.push_back(quad);
    }
  }
  return quads;
}

/// The edge near a point, along `inward`: between pixels, where grey changes most, in the direction of `sign`.
std::optional<Eigen::Vector2d> edge_point(const cv::Mat& grey, const Eigen::Vector2d& at, const Eigen::Vector2d& inward,
                                          double sign) {
  constexpr int reach = 8;  // half pixels
  std::array<double, 2 * reach + 1> slope{};
  for (int k = -reach; k <= reach; ++k) {
    const double s = 0.5 * k;
    slope[static_cast<std::size_t>(k + reach)] =
        sign * (grey_at(grey, at + (s + 0.75) * inward) - grey_at(grey, at + (s - 0.75) * inward));
  }
  const auto best = static_cast<std::size_t>(std::ranges::max_element(slope) - slope.begin());
  if (best == 0 || best + 1 >= slope.size() || !(slope[best] > 0.4 * min_contrast)) return std::nullopt;
  const double before = slope[best - 1], after = slope[best + 1], bend = before - 2.0 * slope[best] + after;
  if (!(bend < 0.0)) return std::nullopt;
  const double s = 0.5 * (static_cast<double>(best) - reach + 0.5 * (before - after) / bend);
  return at + s * inward;
}

/// Plane through the camera that holds an edge, and how far its pixels are from it.
struct EdgePlane {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double rms_px = 0.0;
};

std::optional<EdgePlane> edge_plane(const cv::Mat& grey, const Camera& camera, const Eigen::Vector2d& from,
                                    const Eigen::Vector2d& to, double sign) {
  const Eigen::Vector2d along = (to - from).normalized(), inward(-along.y(), along.x());  // clockwise, y down
  constexpr int num = 24;
  std::vector<Eigen::Vector3d> rays;
  double focal_px = 0.0;
  for (int k = 0; k < num; ++k) {
    const double share = 0.1 + 0.8 * k / (num - 1.0);  // corners are rounded
    const auto px = edge_point(grey, from + share * (to - from), inward, sign);
    if (!px) continue;
    const auto ray = unproject(camera, *px), beside = unproject(camera, *px + inward);
    if (!ray || !beside) continue;
    focal_px += 1.0 / std::max((*ray - *beside).norm(), 1e-9);
    rays.push_back(*ray);
  }
  if (rays.size() < num / 2) return std::nullopt;
  focal_px /= static_cast<double>(rays.size());
  EdgePlane plane;
  constexpr int rounds = 3;
  for (int round = 0; round < rounds; ++round) {
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& ray : rays) scatter += ray * ray.transpose();
    plane.normal = symmetric_eigen3(scatter).vectors.col(0);
    double squares = 0.0;
    for (const Eigen::Vector3d& ray : rays) squares += std::pow(plane.normal.dot(ray), 2);
    const double sigma = std::sqrt(squares / static_cast<double>(rays.size() - 2));
    plane.rms_px = sigma * focal_px;
    const auto left =
        std::erase_if(rays, [&](const Eigen::Vector3d& ray) { return std::abs(plane.normal.dot(ray)) > 2.5 * sigma; });
    if (left == 0) break;
    if (rays.size() < num / 2) return std::nullopt;
  }
  return plane;
}

/// One more look along the edges of an outline. None where they are not straight or not there.
std::optional<SeenRectangle> fitted(const cv::Mat& grey, const Camera& camera, const Quad& quad, double sign) {
  std::array<EdgePlane, 4> planes;
  double rms_px = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto plane = edge_plane(grey, camera, quad[i], quad[(i + 1) % 4], sign);
    if (!plane || plane->rms_px > max_edge_px) return std::nullopt;
    planes[i] = *plane;
    rms_px = std::max(rms_px, plane->rms_px);
  }
  SeenRectangle seen;
  for (std::size_t i = 0; i < 4; ++i) {
    Eigen::Vector3d ray = planes[(i + 3) % 4].normal.cross(planes[i].normal).normalized();
    const auto near = unproject(camera, quad[i]);
    if (!near) return std::nullopt;
    if (ray.dot(*near) < 0.0) ray = -ray;
    const auto px = project(camera, ray);
    if (!px || !((*px - quad[i]).norm() < 5.0)) return std::nullopt;
    seen.corners_px[i] = *px;
  }
  // A line of n points is known to 2 rms/√n at its end; a corner by two of them. Never better than the lens's pixels.
  seen.sigma_px = std::hypot(0.1, 2.0 * rms_px / std::sqrt(24.0));
  return seen;
}

/// Grey values inside, and on both sides of the edges.
void measure_light(const cv::Mat& grey, SeenRectangle& seen) {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : seen.corners_px) centre += 0.25 * corner;
  double sum = 0.0, squares = 0.0, steps = 0.0;
  int num = 0, num_steps = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d &p = seen.corners_px[i], &q = seen.corners_px[(i + 1) % 4];
    const Eigen::Vector2d along = (q - p).normalized(), inward(-along.y(), along.x());
    for (double share = 0.1; share < 0.95; share += 0.1) {
      const Eigen::Vector2d on_edge = p + share * (q - p);
      const double step = grey_at(grey, on_edge + 2.5 * inward) - grey_at(grey, on_edge - 2.5 * inward);
      if (std::isfinite(step)) {
        steps += step;
        ++num_steps;
      }
      for (double depth = 0.15; depth < 0.95; depth += 0.2) {
        const double value = grey_at(grey, on_edge + depth * (centre - on_edge));
        if (!std::isfinite(value)) continue;
        sum += value;
        squares += value * value;
        ++num;
      }
    }
  }
  if (num == 0 || num_steps == 0) return;
  seen.contrast = steps / num_steps;
  seen.inside_sigma = std::sqrt(std::max(0.0, squares / num - std::pow(sum / num, 2)));
}

}  // namespace

std::vector<SeenRectangle> find_rectangles(const cv::Mat& grey, const Camera& camera) {
  cv::Mat bytes;
  grey.convertTo(bytes, CV_8U);
  cv::GaussianBlur(bytes, bytes, {3, 3}, 0.0);
  std::vector<SeenRectangle> found;
  for (const Quad& quad : outlines(bytes)) {
    for (const double sign : {-1.0, 1.0}) {  // darker or brighter inside
      auto seen = fitted(bytes, camera, quad, sign);
      if (seen) seen = fitted(bytes, camera, seen->corners_px, sign);
      if (!seen) continue;
      measure_light(bytes, *seen);
      if (std::abs(seen->contrast) < min_contrast || seen->contrast * sign < 0.0) continue;
      const bool is_known = std::ranges::any_of(found, [&](const SeenRectangle& other) {
        double most = 0.0;
        for (std::size_t i = 0; i < 4; ++i) most = std::max(most, (other.corners_px[i] - seen->corners_px[i]).norm());
        return most < 1.5;
      });
      if (!is_known) found.push_back(*seen);
    }
  }
  std::ranges::sort(found, std::greater{}, [](const SeenRectangle& seen) { return std::abs(seen.contrast); });
  return found;
}

}  // namespace alidade
