#pragma once

#include <Eigen/Geometry>
#include <span>

#include "alidade/imu/imu.h"
#include "alidade/localize/sequence.h"

namespace alidade {

/// Relation of an IMU's rates to the rotations of a camera: cam = ratio · R · imu(t + late) + const.
struct RateMatch {
  std::size_t num = 0;  ///< Compared intervals; if too few, the rest is invalid.
  Eigen::Quaterniond cam_from_imu = Eigen::Quaterniond::Identity();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< Of that rotation, about the camera's axes. [rad⁻²]
  double late_s = 0.0, sigma_late_s = 1e9;                ///< At `mid_s` of the path.
  double clock_rate = 0.0, sigma_clock_rate = 0.0, mid_s = 0.0;  ///< Relative rate error (positive: fast); 0: unclear.
  double ratio = 1.0, sigma_ratio = 1e9;
  double mirrored_chi2 = 0.0;  ///< Decrease of χ² by a reflection instead of a rotation.
  double explained = 0.0;      ///< Share of the camera's rates that a linear function of the IMU's explains.
  double signal_rad_s = 0.0;   ///< RMS of the IMU's rates about their mean, scaled to the camera's.
  Eigen::Vector3d mean_imu = Eigen::Vector3d::Zero(), mean_cam = Eigen::Vector3d::Zero();
};
/// Camera time at which a reading was taken.
[[nodiscard]] double path_time_s(const RateMatch& match, double t_s);
[[nodiscard]] RateMatch match_rates(std::span<const ImuReading> readings, std::span<const TimedPose> path);

}  // namespace alidade
