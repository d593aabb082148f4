#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// What an inertial measurement unit reads at a time, in its own axes: angular rate, and specific force, which is the
/// acceleration less that of gravity (at rest 9.81 m/s² upwards).
struct ImuReading {
  double t_s = 0.0;
  Eigen::Vector3d rate_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d force_m_s2 = Eigen::Vector3d::Zero();
};

/// Densities of an IMU's noise and of the random walks of its biases, per axis. The defaults are those of small MEMS
/// ones; where residuals are larger than these, σ is enlarged.
struct ImuNoise {
  double rate_density = 3e-4;        ///< [rad/s/√Hz]
  double force_density = 3e-3;       ///< [m/s²/√Hz]
  double rate_walk = 2e-5;           ///< [rad/s²/√Hz]
  double force_walk = 1e-3;          ///< [m/s³/√Hz]
  double sigma_rate_bias = 0.02;     ///< At first. [rad/s]
  double sigma_force_bias = 0.3;     ///< At first. [m/s²]
  double sigma_force_scale = 0.003;  ///< Of the accelerometer's scale factor, which all its readings share.
  double sigma_axes = 0.01;          ///< By which axes differ in scale or are not perpendicular, of either sensor.
};

/// How an IMU is fixed to a camera.
struct ImuMounting {
  Rigid3 cam_from_imu;
  double sigma_rotation_rad = 0.02;  ///< About each axis,
  double sigma_position_m = 0.01;    ///< and of each coordinate of its position.
};

/// An IMU beside a camera, with its readings in order of time.
struct Imu {
  std::vector<ImuReading> readings = {};
  std::optional<ImuMounting> mounting = {};  ///< None: its rotation is found by the rotations of both.
  ImuNoise noise = {};
  double gravity_m_s2 = 9.81, sigma_gravity_m_s2 = 0.02;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
