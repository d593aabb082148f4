#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

namespace alidade {

/// A plane through points that a beam passes between.
struct BeamSurface {
  Eigen::Vector3d normal, middle;
  double roughness = 0.0;  ///< The points off it, RMS. [the points' unit]
};

/// Through the points that are nearest to a direction. None: too few around it.
[[nodiscard]] std::optional<BeamSurface> nearest_surface(const Eigen::Vector3d& direction,
                                                         std::span<const Eigen::Vector3d> points_in_cam);

/// The surfaces that a beam may meet, each through the nearest of the most points near a direction that are in one
/// plane and in none before, all around it: a board, and the wall behind it. In order of their numbers of points.
[[nodiscard]] std::vector<BeamSurface> surfaces_around(const Eigen::Vector3d& direction,
                                                       std::span<const Eigen::Vector3d> points_in_cam);

}  // namespace alidade
