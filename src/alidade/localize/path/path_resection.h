#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/localize/filter/feature.h"

namespace alidade {

/// An observation of a point with known position and its covariance.
struct PlacedObservation {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.5;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
};

/// Resection: camera pose from observations of points with known positions; some observations may be mismatches.
struct CameraResection {
  Rigid3 world_from_cam;
  double cost = 0.0;  ///< Σ of squared residuals over σ², each capped at the gate.
  std::size_t num_fit = 0;
  std::vector<bool> fits;  ///< One per observation.
};

/// Starts from each pose in `begin_at`, with Geman–McClure weights (1985) that are first as wide as `widest_px`, then
/// narrower; returns the best pose. Empty: fewer than three observations, or no initial pose.
[[nodiscard]] std::optional<CameraResection> resection(const Camera& camera,
                                                       std::span<const PlacedObservation> observations,
                                                       std::span<const Rigid3> begin_at, double gate,
                                                       double widest_px = 64.0);

/// Poses from random triples of observations, best first (M. A. Fischler & R. C. Bolles, "Random Sample Consensus",
/// 1981).
[[nodiscard]] std::vector<Rigid3> poses_of_threes(const Camera& camera, std::span<const PlacedObservation> observations,
                                                  int num_draws, std::size_t max_poses);

}  // namespace alidade
