#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Why an IMU's readings are not used in a path.
enum class ImuFault {
  none,
  other_time,    ///< None of them lies within the time span of the path,
  few,           ///< or too few, between gaps.
  rate_degrees,  ///< Angular rates are in degrees per second,
  rate_unit,     ///< or larger than the camera's by another factor.
  mirrored,      ///< The axes are left-handed: one has the wrong sign, or two are exchanged.
  mounting,      ///< They are rotated from the given mounting,
  unmounted,     ///< or no mounting is given and the rotations do not determine it.
  other_motion,  ///< Rates and the camera's rotations have nothing in common.
  force_g,       ///< Forces are in units of gravity,
  force_unit,    ///< or on average not near it.
  no_gravity,    ///< Gravity has been subtracted.
  reversed,      ///< Forces have the other sign.
  still,         ///< The camera hardly accelerates: the scale is undetermined.
  misfit,        ///< They contradict the path.
  unsettled,     ///< The path with them does not converge.
};

/// What was found of an IMU with a path: its readings as they are in the camera's frame, and gravity in the world's. σ
/// of each component.
struct ImuEstimate {
  ImuFault fault = ImuFault::none;
  double ratio = 1.0;      ///< Of a unit: camera over IMU, or mean force over gravity.
  double angle_rad = 0.0;  ///< Between the given mounting and that of the rotations.
  bool is_mounting_given = true;
  Rigid3 cam_from_imu;
  Eigen::Vector3d sigma_rotation_rad = Eigen::Vector3d::Zero(), sigma_position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d gravity_in_world = Eigen::Vector3d::Zero(), sigma_gravity = Eigen::Vector3d::Zero();
  double gravity_sigmas =
      0.0;  ///< By how many of their σ gravity's size and the forces' scale factor are pulled apart.
  /// By how many σ the axes of a sensor differ in scale or are not perpendicular, the most of one number; and its size.
  double axes_sigmas = 0.0, axes_differ = 0.0;
  /// At the end, in the IMU's axes.
  Eigen::Vector3d rate_bias = Eigen::Vector3d::Zero(), sigma_rate_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d force_bias = Eigen::Vector3d::Zero(), sigma_force_bias = Eigen::Vector3d::Zero();
  double late_s = 0.0, sigma_late_s = 0.0;          ///< Its clock less the camera's; corrected.
  double clock_rate = 0.0, sigma_clock_rate = 0.0;  ///< By which its clock is fast, relative; corrected.
  double frame_period_s = 0.0;
  double scale = 1.0, sigma_scale = 0.0;                     ///< Metres per unit of the path without it; σ over it.
  double rate_noise_factor = 1.0, force_noise_factor = 1.0;  ///< σ of the noise over the given one, where larger.
  /// Density of the biases' walks over the given one, where larger, and by how much they change, in the IMU's axes.
  double rate_walk_factor = 1.0, force_walk_factor = 1.0;
  Eigen::Vector3d rate_drift = Eigen::Vector3d::Zero(), force_drift = Eigen::Vector3d::Zero();
  std::size_t num_steps = 0;                      ///< From frame to frame: used,
  std::size_t num_rejected = 0, num_missing = 0;  ///< rejected, and without readings.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
