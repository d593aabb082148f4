#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

namespace alidade {

/// A plane fitted to points around a beam.
struct BeamSurface {
  Eigen::Vector3d normal, middle;
  double roughness = 0.0;  ///< RMS distance of the points from it. [the points' unit]
};

/// Plane through the points nearest to a direction. Empty: too few points around it.
[[nodiscard]] std::optional<BeamSurface> nearest_surface(const Eigen::Vector3d& direction,
                                                         std::span<const Eigen::Vector3d> points_in_cam);

/// All surfaces that a beam may meet, such as a board and the wall behind it. Each is fitted to the nearest points of
/// the largest coplanar set near the direction that surrounds it, without earlier ones. Largest set first.
[[nodiscard]] std::vector<BeamSurface> surfaces_around(const Eigen::Vector3d& direction,
                                                       std::span<const Eigen::Vector3d> points_in_cam);

}  // namespace alidade
