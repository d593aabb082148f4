#include "alidade/localize/checks/beam_surfaces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Points = std::vector<Eigen::Vector3d>;

/// The points nearest in angle to a direction, at most `most` of them.
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

/// Least-squares plane through the nearest of the points, at most six. The roughness is scaled to that of six.
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

/// Whether a direction is surrounded by points.
bool surround(const Eigen::Vector3d& direction, const Points& points) {
  const Eigen::Vector3d x = direction.unitOrthogonal(), y = direction.cross(x);
  std::vector<double> angles;
  for (const Eigen::Vector3d& point : points) angles.push_back(std::atan2(y.dot(point), x.dot(point)));
  std::ranges::sort(angles);
  double widest = angles.front() + 2.0 * std::numbers::pi - angles.back();
  for (std::size_t i = 1; i < angles.size(); ++i) widest = std::max(widest, angles[i] - angles[i - 1]);
  return widest < std::numbers::pi;
}

/// The largest set of points coplanar with three of them. `tolerance`: relative to the distance.
Points most_in_plane(const Points& points, double tolerance) {
  struct Plane {
    Eigen::Vector3d normal, in_plane;
    [[nodiscard]] bool has(const Eigen::Vector3d& point, double tolerance) const {
      return std::abs(normal.dot(point - in_plane)) < tolerance * in_plane.norm();
    }
  };
  Plane best{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  std::ptrdiff_t most = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t j = i + 1; j < points.size(); ++j)
      for (std::size_t k = j + 1; k < points.size(); ++k) {
        const Eigen::Vector3d normal = (points[j] - points[i]).cross(points[k] - points[i]);
        if (!(normal.norm() > 0.0)) continue;
        const Plane plane{normal.normalized(), points[i]};
        const auto num = std::ranges::count_if(points, [&](const auto& point) { return plane.has(point, tolerance); });
        if (num > most) best = plane, most = num;
      }
  Points near;
  for (const Eigen::Vector3d& point : points)
    if (best.has(point, tolerance)) near.push_back(point);
  return near;
}

/// Points in one plane within a coarse tolerance, and those within a fine one if they are at least three quarters as
/// many: at an edge the others lie behind it. If the latter do not surround the beam, the former.
struct PlanePoints {
  Points rough, smooth;
};
PlanePoints plane_points(const Eigen::Vector3d& direction, const Points& points) {
  constexpr double tolerance = 0.01;
  constexpr std::ptrdiff_t of_four = 3;
  PlanePoints of_plane{most_in_plane(points, tolerance), {}};
  for (const double smoother : {0.001, 0.002}) {
    of_plane.smooth = most_in_plane(points, smoother);
    const auto num = static_cast<std::ptrdiff_t>(of_plane.smooth.size());
    const auto shared = std::ranges::count_if(of_plane.smooth, [&](const Eigen::Vector3d& point) {
      return std::ranges::find(of_plane.rough, point) != of_plane.rough.end();
    });
    const bool is_same = 4 * shared >= of_four * num;  // not a surface in front of it
    const bool has_most = is_same && 4 * num >= of_four * std::ssize(of_plane.rough);
    if (has_most && surround(direction, of_plane.smooth)) return of_plane;
  }
  of_plane.smooth = of_plane.rough;
  return of_plane;
}

/// Plane through the nearest smooth points, with the roughness of the nearest of all: a smooth surface may be curved.
BeamSurface surface_through(const PlanePoints& points) {
  const Points& rough = points.rough;
  BeamSurface surface = plane_through(points.smooth);
  const std::size_t num = std::min(rough.size(), num_near);
  double squares = 0.0;
  for (std::size_t i = 0; i < num; ++i)
    squares += std::pow(surface.normal.dot(rough[i] - surface.middle), 2) / static_cast<double>(num);
  surface.roughness = std::max(surface.roughness, std::sqrt(squares));
  return surface;
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
    const PlanePoints of_one = plane_points(direction, near);
    if (of_one.smooth.size() < enough) break;
    if (surround(direction, of_one.smooth)) surfaces.push_back(surface_through(of_one));
    for (const Points& taken : {of_one.rough, of_one.smooth})
      std::erase_if(near, [&](const Eigen::Vector3d& point) { return std::ranges::find(taken, point) != taken.end(); });
  }
  return surfaces;
}

}  // namespace alidade
