#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "alidade/pantilt/head.h"
#include "alidade/pantilt/intrinsics_history.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Intrinsics of one observation where they differ from those of its head, and their σ as a multiple of the σ in the
/// rig's uncertainty (of fx, fy, cx, cy; each σ relative to its focal length).
struct ObservationLens {
  Eigen::Vector4d k = Eigen::Vector4d::Zero();
  Eigen::Vector4d error_scale = Eigen::Vector4d::Ones();
};

/// One observation of the target: its pixel in a head's camera, and the encoder readings at the same instant.
struct TargetObservation {
  double t_capture_s = 0.0;  ///< Time of exposure and of the encoder readings.
  double t_arrival_s = 0.0;  ///< Time at which the observation became available; ≥ t_capture_s.
  std::size_t head = 0;      ///< Index in the rig's list of heads.
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;  ///< σ of one coordinate of this observation; 0: the common σ.
  std::optional<ObservationLens> lens = {};
  Eigen::Vector2d turns = Eigen::Vector2d::Zero();  ///< Whole revolutions that were subtracted from the readings.
};

[[nodiscard]] inline double sigma_px_of(const TargetObservation& observation, double of_all_px) {
  return observation.sigma_px > 0.0 ? observation.sigma_px : of_all_px;
}

/// The ray of an observation. None if the lens model has no ray for the pixel.
[[nodiscard]] std::optional<WorldRay> ray_in_world(const RigHead& rig_head, const TargetObservation& observation);

/// A target's true positions in the world, in chronological order.
struct TrueTrack {
  std::vector<double> t_s;
  std::vector<Eigen::Vector3d> position;

  /// Cubic interpolation of two positions before and two after if no gap is more than twice another, else linear.
  /// None before the first time and after the last.
  [[nodiscard]] std::optional<Eigen::Vector3d> at(double t_s) const;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
