#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Why an IMU's readings are not used for a path.
enum class ImuFault {
  none,
  other_time,    ///< No reading lies within the time span of the path.
  few,           ///< Too few readings lie within it, between gaps.
  rate_degrees,  ///< Angular rates are in degrees per second.
  rate_unit,     ///< Angular rates are larger than the camera's by another factor.
  mirrored,      ///< The axes are left-handed: one has the wrong sign, or two are exchanged.
  mounting,      ///< The axes are rotated from the given mounting.
  unmounted,     ///< No mounting is given, and the rotations do not determine it.
  other_motion,  ///< Angular rates and the camera's rotations have nothing in common.
  force_g,       ///< Specific forces are in units of gravity.
  force_unit,    ///< The mean specific force is not near gravity.
  no_gravity,    ///< Gravity has been subtracted.
  reversed,      ///< Specific forces have the opposite sign.
  still,         ///< The camera hardly accelerates: the scale is undetermined.
  misfit,        ///< The readings contradict the path.
  unsettled,     ///< The solution with the readings does not converge.
};

/// An IMU as estimated with a path: its pose and readings relative to the camera, and gravity in the world's frame,
/// with σ of each component.
struct ImuEstimate {
  ImuFault fault = ImuFault::none;
  double ratio = 1.0;      ///< Ratio of a wrong unit: camera over IMU, or mean force over gravity.
  double angle_rad = 0.0;  ///< Angle between the given mounting and the one that the rotations indicate.
  bool is_mounting_given = true;
  Rigid3 cam_from_imu;
  Eigen::Vector3d sigma_rotation_rad = Eigen::Vector3d::Zero(), sigma_position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d gravity_in_world = Eigen::Vector3d::Zero(), sigma_gravity = Eigen::Vector3d::Zero();
  double gravity_sigmas =
      0.0;  ///< Joint deviation of gravity's magnitude and the force scale factors from the given ones, in σ.
  /// Largest deviation of a sensor's axes, in scale or from perpendicularity: in σ, and the size of the largest one.
  double axes_sigmas = 0.0, axes_differ = 0.0;
  /// Biases at the end of the path, in the IMU's axes.
  Eigen::Vector3d rate_bias = Eigen::Vector3d::Zero(), sigma_rate_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d force_bias = Eigen::Vector3d::Zero(), sigma_force_bias = Eigen::Vector3d::Zero();
  double late_s = 0.0, sigma_late_s = 0.0;          ///< IMU clock minus camera clock; corrected.
  double clock_rate = 0.0, sigma_clock_rate = 0.0;  ///< Relative rate error of its clock (positive: fast); corrected.
  double frame_period_s = 0.0;
  double scale = 1.0, sigma_scale = 0.0;                     ///< Metres per unit of the path without it; relative σ.
  double rate_noise_factor = 1.0, force_noise_factor = 1.0;  ///< σ of the noise over the given σ, where larger.
  /// Density of the biases' random walks over the given one, where larger, and the biases' change, in the IMU's axes.
  double rate_walk_factor = 1.0, force_walk_factor = 1.0;
  Eigen::Vector3d rate_drift = Eigen::Vector3d::Zero(), force_drift = Eigen::Vector3d::Zero();
  std::size_t num_steps = 0;                      ///< Intervals between frames: used,
  std::size_t num_rejected = 0, num_missing = 0;  ///< rejected, and without readings.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
