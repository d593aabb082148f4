#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// How the rotation of a camera was measured.
enum class RotationSource {
  none,      ///< Not measured: the pixels must determine it.
  rate,      ///< Angular rate, rad/s, in the camera frame.
  head,      ///< Pan and tilt (and roll) of a head, rad; see head_rotation.h.
  attitude,  ///< base_from_cam as a quaternion.
};

/// The word for a source in files.
[[nodiscard]] inline const char* source_name(RotationSource source) {
  constexpr std::array names{"none", "rate", "head", "attitude"};
  return names[static_cast<std::size_t>(source)];
}

inline constexpr double not_seen = std::numeric_limits<double>::quiet_NaN();

/// One instant of a rotating camera: its rotation, and its pixels of static points. Quantities that were not measured
/// are NaN (the attitude: all zeros).
struct RotationRow {
  double t_s = 0.0;
  Eigen::Vector3d rate_rad_per_s = Eigen::Vector3d::Constant(not_seen);     ///< Camera frame; source `rate`.
  Eigen::Vector3d pan_tilt_roll_rad = Eigen::Vector3d::Constant(not_seen);  ///< Source `head`.
  Eigen::Quaterniond base_from_cam{0.0, 0.0, 0.0, 0.0};                     ///< Source `attitude`.
  Eigen::Vector3d velocity_m_per_s = Eigen::Vector3d::Zero();  ///< Velocity of the camera centre, in the camera frame.
  double range_m = not_seen;                                   ///< From the camera centre to point `range_point`.
  std::vector<Eigen::Vector2d> px;                             ///< One per point; NaN if not visible.
};

[[nodiscard]] inline bool is_seen(const Eigen::Vector2d& px) { return std::isfinite(px.x()) && std::isfinite(px.y()); }

/// True intrinsics of a row, if the log contains them: fx, fy, cx, cy. [px]
using TrueIntrinsics = std::array<double, 4>;

/// Measurements of a rotating camera in chronological order.
struct RotationLog {
  RotationSource source = RotationSource::rate;
  std::size_t num_points = 0;   ///< Every row has this many pixels.
  std::size_t range_point = 0;  ///< Index of the point that `range_m` refers to.
  bool has_roll_rate = false;   ///< Source `rate`: ω_z was given; without it ω_z is zero.
  bool has_velocity = false;
  std::optional<double> sigma_scale = {};     ///< Relative σ of the scale of angles or rates; 0: exact; none: unknown.
  std::optional<double> sigma_parallax = {};  ///< σ of camera centre off the axes, along the view, over distance.
  std::vector<RotationRow> rows = {};
  std::vector<TrueIntrinsics> truth = {};  ///< One per row, or none.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
