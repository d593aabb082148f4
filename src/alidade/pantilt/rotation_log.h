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

/// How the rotation of a camera was measured while it rotated.
enum class RotationSource {
  none,      ///< Not measured: the pixels must determine it.
  rate,      ///< Angular rate, rad/s, in the camera frame.
  head,      ///< Pan and tilt (and roll) of a head, rad; see head_rotation.h.
  attitude,  ///< base_from_cam as a quaternion.
};

/// The word of it in files.
[[nodiscard]] inline const char* source_name(RotationSource source) {
  constexpr std::array names{"none", "rate", "head", "attitude"};
  return names[static_cast<std::size_t>(source)];
}

inline constexpr double not_seen = std::numeric_limits<double>::quiet_NaN();

/// One instant of a rotating camera: its rotation, and where it saw static points. What was not measured
/// is NaN (the attitude: all zeros).
struct RotationRow {
  double t_s = 0.0;
  Eigen::Vector3d rate_rad_per_s = Eigen::Vector3d::Constant(not_seen);     ///< Camera frame; source `rate`.
  Eigen::Vector3d pan_tilt_roll_rad = Eigen::Vector3d::Constant(not_seen);  ///< Source `head`.
  Eigen::Quaterniond base_from_cam{0.0, 0.0, 0.0, 0.0};                     ///< Source `attitude`.
  Eigen::Vector3d velocity_m_per_s = Eigen::Vector3d::Zero();  ///< Of the camera centre, in the camera frame.
  double range_m = not_seen;                                   ///< From the camera centre to point `range_point`.
  std::vector<Eigen::Vector2d> px;                             ///< One per point; NaN where it was not seen.
};

[[nodiscard]] inline bool is_seen(const Eigen::Vector2d& px) { return std::isfinite(px.x()) && std::isfinite(px.y()); }

/// True intrinsics of a row, where the log knows them: fx, fy, cx, cy. [px]
using TrueIntrinsics = std::array<double, 4>;

/// A rotating camera's measurements in order of time.
struct RotationLog {
  RotationSource source = RotationSource::rate;
  std::size_t num_points = 0;   ///< Every row has this many pixels.
  std::size_t range_point = 0;  ///< Which point `range_m` belongs to.
  bool has_roll_rate = false;   ///< Source `rate`: ω_z was given; without it ω_z is zero.
  bool has_velocity = false;
  std::optional<double> sigma_scale = {};  ///< Of the measured angles or rates, as a share; 0: exact; none: not given.
  std::optional<double> sigma_parallax = {};  ///< Camera centre off the axes along the view over the points' distance.
  std::vector<RotationRow> rows = {};
  std::vector<TrueIntrinsics> truth = {};  ///< One per row, or none.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
