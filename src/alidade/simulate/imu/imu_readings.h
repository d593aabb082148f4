#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "alidade/imu/imu.h"

namespace alidade {

/// An IMU that is fixed to a camera, as `localize --imu` takes it.
struct ImuScene {
  double rate_hz = 200.0;
  ImuMounting mounting = {{Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0.06, -0.02, 0.03}}, 0.01, 0.005};
  ImuNoise noise = {};
  Eigen::Vector3d gravity_in_world{0.4, 9.79, -0.5};  ///< Of about 9.81 m/s².
  Eigen::Vector3d rate_bias{0.004, -0.007, 0.005};    ///< At first. [rad/s]
  Eigen::Vector3d force_bias{0.08, -0.05, 0.11};      ///< At first. [m/s²]
  double force_scale = 0.0;                           ///< True force over the read one, less 1.
  /// Readings are (I + A) the true ones: scales that differ, axes that are not perpendicular or are rotated.
  Eigen::Matrix3d rate_axes = Eigen::Matrix3d::Zero(), force_axes = Eigen::Matrix3d::Zero();
  double late_s = 0.0;  ///< Of its clock.
};

struct ImuSequence {
  std::vector<ImuReading> readings;
  std::vector<Eigen::Vector3d> rate_bias, force_bias;  ///< The truth at each.
};

/// Readings from `from_s` to `to_s` of the camera's time. The path has to be smooth: rates and accelerations are its
/// central differences over 0.2 ms. Same seed, same readings.
[[nodiscard]] ImuSequence simulate_imu(const ImuScene& scene, const std::function<Rigid3(double t_s)>& world_from_cam,
                                       double from_s, double to_s, std::uint64_t seed);

}  // namespace alidade
