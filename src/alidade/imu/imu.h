#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A reading of an inertial measurement unit, in its own axes: angular rate, and specific force, which is the
/// acceleration minus gravity (at rest 9.81 m/s² upwards).
struct ImuReading {
  double t_s = 0.0;
  Eigen::Vector3d rate_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d force_m_s2 = Eigen::Vector3d::Zero();
};

/// Densities of an IMU's noise and of the random walks of its biases, per axis. The defaults are those of small MEMS
/// units; σ is enlarged if residuals exceed them.
struct ImuNoise {
  double rate_density = 3e-4;        ///< [rad/s/√Hz]
  double force_density = 3e-3;       ///< [m/s²/√Hz]
  double rate_walk = 2e-5;           ///< [rad/s²/√Hz]
  double force_walk = 1e-3;          ///< [m/s³/√Hz]
  double sigma_rate_bias = 0.02;     ///< σ of the initial bias. [rad/s]
  double sigma_force_bias = 0.3;     ///< σ of the initial bias. [m/s²]
  double sigma_force_scale = 0.003;  ///< σ of the accelerometer's scale factor, relative; common to all its readings.
  double sigma_axes = 0.01;          ///< σ of the axes' scale differences and non-orthogonality, for either sensor.
};

/// How an IMU is mounted relative to a camera.
struct ImuMounting {
  Rigid3 cam_from_imu;
  double sigma_rotation_rad = 0.02;  ///< σ about each axis,
  double sigma_position_m = 0.01;    ///< and of each coordinate of its position.
};

/// An IMU mounted beside a camera, with its readings in order of time.
struct Imu {
  std::vector<ImuReading> readings = {};
  std::optional<ImuMounting> mounting = {};  ///< None: its rotation is estimated from the rotations of both.
  ImuNoise noise = {};
  double gravity_m_s2 = 9.81, sigma_gravity_m_s2 = 0.02;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
