#include "alidade/localize/checks/beam_surfaces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Points = std::vector<Eigen::Vector3d>;

/// The nearest to a direction, at most so many, as angles go.
Points near_direction(const Eigen::Vector3d& direction, std::span<const Eigen::Vector3d> points_in_cam,
                      std::size_t most) {
  constexpr double far_off = 0.25;
  struct Near {
    double off = 0.0;  ///< From the direction, over the depth.
    Eigen::Vector3d point;
  };
  std::vector<Near> near;
  for (const Eigen::Vector3d& point : points_in_cam) {
    const double along = direction.dot(point);
    if (!(along > 0.0)) continue;
    const double off = (point - along * direction).norm() / along;
    if (off < far_off) near.push_back({off, point});
  }
  std::ranges::stable_sort(near, {}, &Near::off);
  Points points;
  for (std::size_t i = 0; i < std::min(most, near.size()); ++i) points.push_back(near[i].point);
  return points;
}

constexpr std::size_t num_near = 6;

/// Through the nearest of points, by least squares. They are off it as six would be.
BeamSurface plane_through(Points points) {
  constexpr std::size_t of_plane = 3;
  points.resize(std::min(points.size(), num_near));
  const double spare = 2.0 * static_cast<double>(points.size() - of_plane);
  BeamSurface plane{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  for (const Eigen::Vector3d& point : points) plane.middle += point / static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points) scatter += (point - plane.middle) * (point - plane.middle).transpose();
  const SymmetricEigen3 eigen = symmetric_eigen3(scatter);
  plane.normal = eigen.vectors.col(0);
  plane.roughness = std::sqrt(std::max(eigen.values[0], 0.0) / spare);
  return plane;
}

/// Whether points are on all sides of a direction.
bool surround(const Eigen::Vector3d& direction, const Points& points) {
  const Eigen::Vector3d x = direction.unitOrthogonal(), y = direction.cross(x);
  std::vector<double> angles;
  for (const Eigen::Vector3d& point : points) angles.push_back(std::atan2(y.dot(point), x.dot(point)));
  std::ranges::sort(angles);
  double widest = angles.front() + 2.0 * std::numbers::pi - angles.back();
  for (std::size_t i = 1; i < angles.size(); ++i) widest = std::max(widest, angles[i] - angles[i - 1]);
  return widest < std::numbers::pi;
}

/// Those of the points that are in the plane through three of them with the most, and out of `points`.
Points taken_plane(Points& points) {
  constexpr double tolerance = 0.01;  // of the distance
  Points best;
  const auto near_plane = [&](const Eigen::Vector3d& normal, const Eigen::Vector3d& in_plane) {
    Points near;
    for (const Eigen::Vector3d& point : points)
      if (std::abs(normal.dot(point - in_plane)) < tolerance * in_plane.norm()) near.push_back(point);
    return near;
  };
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t j = i + 1; j < points.size(); ++j)
      for (std::size_t k = j + 1; k < points.size(); ++k) {
        const Eigen::Vector3d normal = (points[j] - points[i]).cross(points[k] - points[i]);
        if (!(normal.norm() > 0.0)) continue;
        Points near = near_plane(normal.normalized(), points[i]);
        if (near.size() > best.size()) best = std::move(near);
      }
  std::erase_if(points, [&](const Eigen::Vector3d& point) { return std::ranges::find(best, point) != best.end(); });
  return best;
}

}  // namespace

std::optional<BeamSurface> nearest_surface(const Eigen::Vector3d& direction,
                                           std::span<const Eigen::Vector3d> points_in_cam) {
  const Points near = near_direction(direction, points_in_cam, num_near);
  if (near.size() < num_near) return std::nullopt;
  return plane_through(near);
}

std::vector<BeamSurface> surfaces_around(const Eigen::Vector3d& direction,
                                         std::span<const Eigen::Vector3d> points_in_cam) {
  constexpr std::size_t most = 12, enough = 4;
  Points near = near_direction(direction, points_in_cam, most);
  std::vector<BeamSurface> surfaces;
  while (near.size() >= enough) {
    const Points of_one = taken_plane(near);
    if (of_one.size() < enough) break;
    if (surround(direction, of_one)) surfaces.push_back(plane_through(of_one));
  }
  return surfaces;
}

}  // namespace alidade
