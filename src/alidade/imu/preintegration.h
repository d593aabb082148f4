#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>

#include "alidade/imu/imu.h"

namespace alidade {

/// The readings without those of a frozen sensor: of ten or more that are equal in all digits, for 0.1 s or longer, the
/// first is kept. The removed readings leave a gap.
[[nodiscard]] std::vector<ImuReading> without_frozen(std::vector<ImuReading> readings);

/// Preintegrated IMU readings between two times, in the IMU's axes at the first: rotation, and the effect of specific
/// force f alone on velocity and position, ∫ R f and ∫∫ R f. With position p, velocity v and rotation R of the IMU at
/// the first time, p⁺ at the second is p + v Δ + ½ g Δ² + R `position`, v⁺ is v + g Δ + R `velocity`. C. Forster et
/// al., "On-Manifold Preintegration for Real-Time Visual-Inertial Odometry", TRO 33(1), 2017.
struct ImuStep {
  double dt_s = 0.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< first_from_second
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero(), position = Eigen::Vector3d::Zero();
  /// Derivatives with respect to the biases; for the rotation on the right: R exp(J δb).
  Eigen::Matrix3d rotation_by_rate = Eigen::Matrix3d::Zero(), velocity_by_rate = Eigen::Matrix3d::Zero(),
                  position_by_rate = Eigen::Matrix3d::Zero(), velocity_by_force = Eigen::Matrix3d::Zero(),
                  position_by_force = Eigen::Matrix3d::Zero();
  /// Derivatives with respect to a common delay of both ends.
  Eigen::Vector3d rotation_by_time = Eigen::Vector3d::Zero(), velocity_by_time = Eigen::Vector3d::Zero(),
                  position_by_time = Eigen::Vector3d::Zero();
};

/// Empty if the readings do not extend from the first time to the second, or have a gap longer than `max_gap_s`. Rate
/// and force are interpolated linearly between readings. `rate_bias` and `force_bias` are subtracted.
[[nodiscard]] std::optional<ImuStep> preintegrated(std::span<const ImuReading> readings, double from_s, double to_s,
                                                   double max_gap_s, const Eigen::Vector3d& rate_bias,
                                                   const Eigen::Vector3d& force_bias);

/// The reading at a time, interpolated between the two around it. Empty before the first and after the last.
[[nodiscard]] std::optional<ImuReading> reading_at(std::span<const ImuReading> readings, double t_s);

/// Median of the times between readings; 0: fewer than two readings.
[[nodiscard]] double usual_period_s(std::span<const ImuReading> readings);

}  // namespace alidade
