#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "alidade/imu/imu.h"

namespace alidade {

/// An IMU fixed to a camera, as `localize --imu` uses it.
struct ImuScene {
  double rate_hz = 200.0;
  ImuMounting mounting = {{Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0.06, -0.02, 0.03}}, 0.01, 0.005};
  ImuNoise noise = {};
  Eigen::Vector3d gravity_in_world{0.4, 9.79, -0.5};  ///< About 9.81 m/s² in size.
  Eigen::Vector3d rate_bias{0.004, -0.007, 0.005};    ///< Initial bias. [rad/s]
  Eigen::Vector3d force_bias{0.08, -0.05, 0.11};      ///< Initial bias. [m/s²]
  double force_scale = 0.0;                           ///< True force over the reading, minus 1.
  /// Readings are (I + A) times the true values: unequal scales, axes that are not perpendicular or are rotated.
  Eigen::Matrix3d rate_axes = Eigen::Matrix3d::Zero(), force_axes = Eigen::Matrix3d::Zero();
  double late_s = 0.0;  ///< Delay of its clock.
};

struct ImuSequence {
  std::vector<ImuReading> readings;
  std::vector<Eigen::Vector3d> rate_bias, force_bias;  ///< The true biases at each reading.
};

/// Readings from `from_s` to `to_s` of the camera's time. The path must be smooth: rates and accelerations are its
/// central differences over 0.2 ms. Same seed, same readings.
[[nodiscard]] ImuSequence simulate_imu(const ImuScene& scene, const std::function<Rigid3(double t_s)>& world_from_cam,
                                       double from_s, double to_s, std::uint64_t seed);

}  // namespace alidade
