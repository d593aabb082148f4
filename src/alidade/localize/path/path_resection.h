#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/localize/filter/feature.h"

namespace alidade {

/// An observation of a point whose position is known, with its covariance.
struct PlacedObservation {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.5;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
};

/// Resection: a camera's pose from observations of known positions, some of which may be mismatched.
struct CameraResection {
  Rigid3 world_from_cam;
  double cost = 0.0;  ///< Squares over σ², of each observation at most the gate.
  std::size_t num_fit = 0;
  std::vector<bool> fits;  ///< One per observation.
};

/// From each of the poses to begin at, weights that fall with a residual (Geman & McClure 1985), as wide as `widest_px`
/// at first, then narrower; the one that explains most. None: fewer than three observations, or nothing to begin at.
[[nodiscard]] std::optional<CameraResection> resection(const Camera& camera,
                                                       std::span<const PlacedObservation> observations,
                                                       std::span<const Rigid3> begin_at, double gate,
                                                       double widest_px = 64.0);

/// Poses from drawn sets of three observations, those that explain most first (M. A. Fischler & R. C. Bolles, "Random
/// Sample Consensus", 1981).
[[nodiscard]] std::vector<Rigid3> poses_of_threes(const Camera& camera, std::span<const PlacedObservation> observations,
                                                  int num_draws, std::size_t max_poses);

}  // namespace alidade
