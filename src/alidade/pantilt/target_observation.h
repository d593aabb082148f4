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

/// Intrinsics that an observation was taken under, where they are not its head's own, and their σ in units of the σ
/// that the rig's errors have of them (of fx, fy, cx, cy; both over the focal length).
struct ObservationLens {
  Eigen::Vector4d k = Eigen::Vector4d::Zero();
  Eigen::Vector4d error_scale = Eigen::Vector4d::Ones();
};

/// One observation of the target: where a head's camera saw it, and what the encoders read at that instant.
struct TargetObservation {
  double t_capture_s = 0.0;  ///< When the image was taken and the encoders read.
  double t_arrival_s = 0.0;  ///< When it was known; ≥ t_capture_s.
  std::size_t head = 0;      ///< Index in the rig's list of heads.
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;  ///< Of one coordinate of this observation; 0: that of all.
  std::optional<ObservationLens> lens = {};
  Eigen::Vector2d turns = Eigen::Vector2d::Zero();  ///< That were taken off the readings, whole ones.
};

[[nodiscard]] inline double sigma_px_of(const TargetObservation& observation, double of_all_px) {
  return observation.sigma_px > 0.0 ? observation.sigma_px : of_all_px;
}

/// The ray of an observation. None where the lens has no ray there.
[[nodiscard]] std::optional<WorldRay> ray_in_world(const RigHead& rig_head, const TargetObservation& observation);

/// A target's true position at some times, in order of time.
struct TrueTrack {
  std::vector<double> t_s;
  std::vector<Eigen::Vector3d> position;

  /// By the cubic through two positions before and two after, of which none is twice as far as another; else linear.
  /// None before the first time and after the last.
  [[nodiscard]] std::optional<Eigen::Vector3d> at(double t_s) const;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
