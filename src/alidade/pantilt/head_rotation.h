#pragma once

#include <Eigen/Geometry>

#include "alidade/geometry/so3.h"

namespace alidade {

/// base_from_cam of a pan-over-tilt head with a roll axis along the view: pan > 0 turns left, tilt > 0 turns up, roll >
/// 0 turns the camera clockwise as it sees itself (about +z). All zero: the camera's axes are the base's. base_from_cam
/// = R_y(−pan) R_x(tilt) R_z(roll), with x right, y down, z forward.
[[nodiscard]] inline Eigen::Quaterniond base_from_cam_rotation(const Eigen::Vector3d& pan_tilt_roll_rad) {
  return exp_so3({0.0, -pan_tilt_roll_rad.x(), 0.0}) * exp_so3({pan_tilt_roll_rad.y(), 0.0, 0.0}) *
         exp_so3({0.0, 0.0, pan_tilt_roll_rad.z()});
}

/// The same for a head whose tilt axis is rotated by this angle about the optical axis, relative to perpendicular to
/// the pan axis.
[[nodiscard]] inline Eigen::Quaterniond base_from_cam_rotation(const Eigen::Vector3d& pan_tilt_roll_rad,
                                                               double axes_skew_rad) {
  const Eigen::Vector3d tilt_axis(std::cos(axes_skew_rad), std::sin(axes_skew_rad), 0.0);
  return exp_so3({0.0, -pan_tilt_roll_rad.x(), 0.0}) * exp_so3(pan_tilt_roll_rad.y() * tilt_axis) *
         exp_so3({0.0, 0.0, pan_tilt_roll_rad.z()});
}

/// Angular rate in the camera frame of a head that rotates at these rates: without roll
/// (τ̇, −α̇ cos τ, α̇ sin τ), so that ω_z is zero only at zero tilt.
[[nodiscard]] inline Eigen::Vector3d head_rate_in_cam(const Eigen::Vector3d& pan_tilt_roll_rad,
                                                      const Eigen::Vector3d& rate_rad_per_s) {
  const double tilt = pan_tilt_roll_rad.y(), pan_rate = rate_rad_per_s.x();
  const Eigen::Vector3d before_roll(rate_rad_per_s.y(), -pan_rate * std::cos(tilt), pan_rate * std::sin(tilt));
  return exp_so3({0.0, 0.0, -pan_tilt_roll_rad.z()}) * before_roll + Eigen::Vector3d(0.0, 0.0, rate_rad_per_s.z());
}

}  // namespace alidade
