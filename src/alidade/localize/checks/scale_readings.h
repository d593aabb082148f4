#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

// Scale from other sensors of a vehicle, a pressure sensor or a rangefinder. They scale a path that is known up to
// scale, and check a path in metres.

namespace alidade {

struct ReadScale {
  double scale = 1.0;      ///< Metres per unit of the path.
  double sigma_rel = 1.0;  ///< Relative σ of the scale.
  std::size_t num_used = 0, num_rejected = 0;
  double late_s = 0.0;     ///< Readings' clock minus the path's, if significant; corrected.
  double offset_m = 0.0;   ///< Constant excess of a rangefinder's readings, if significant.
  double aside_rad = 0.0;  ///< Angle by which a rangefinder's beam deviates from the given direction, if significant.
  /// Relative scale error if all readings were 0.1 m too long, where that would be undetectable; else 0.
  double hidden_offset_rel = 0.0;
  double lag_s = 0.0;                 ///< Time constant of a low-pass filter in a depth sensor or odometry, if any.
  double jump_m = 0.0, jump_s = 0.0;  ///< Jump of a depth sensor's readings, and its time, if any.
  /// ln of another scale over this one, on which at least half as many readings of a rangefinder agree, from a surface
  /// before or behind; else 0.
  double other_log_scale = 0.0;
  double slip_from_s = 0.0, slip_to_s = 0.0, slip_ratio = 0.0;  ///< Longest slip of odometry: when, and by what factor.
  bool is_drifting = false;
  double drift_m = 0.0;  ///< Total change of the offset of a depth sensor, if it drifts.
  /// Estimated position of a depth sensor in the camera's frame, with σ, if it differs from the given one; else 0.
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero(), sigma_arm_m = Eigen::Vector3d::Zero();
  double noise_factor = 1.0;  ///< RMS of a depth sensor's residuals, over their σ.
  double arm_effect = 0.0;    ///< Change of ln scale if a depth sensor's position, given without σ, is 1 cm off.
};

/// The pose at a time, interpolated. Empty outside the path, or if one of the two frames around it has no pose.
[[nodiscard]] std::optional<Rigid3> pose_at(std::span<const PathStep> path, double t_s);

/// Covariance of the position at a time, in the world frame [the path's unit²]: that of the frame at or after it.
[[nodiscard]] Eigen::Matrix3d position_cov_at(std::span<const PathStep> path, double t_s);

/// Persistent part of the mean square of residuals, in order of time: mean square minus half the mean squared
/// difference of neighbours, in the unit of `left`, squared. Averaging more readings does not reduce it.
[[nodiscard]] double persistent_square(std::span<const Eigen::Vector3d> left);

/// The input of a sensor from a path: position and rotation of the camera, as components that a low-pass filter
/// averages independently.
struct SensorPath {
  using Numbers = Eigen::Matrix<double, 3, 4>;  ///< Position, and the camera's axes.
  struct Step {
    double t_s = 0.0;
    bool is_shown = false;
    Numbers numbers = Numbers::Zero();
    [[nodiscard]] bool has_pose() const { return is_shown; }
  };
  std::vector<Step> steps;

  explicit SensorPath(std::span<const PathStep> path);
  /// Output of a first-order low-pass filter with that time constant; empty until it has forgotten its first value.
  [[nodiscard]] SensorPath filtered(double tau_s) const;
  /// Interpolated between the two frames around a time. Empty outside the path, or if one of them has no pose.
  [[nodiscard]] std::optional<Numbers> at(double t_s) const;
};

/// Positions of a path as seen through such a filter.
[[nodiscard]] std::vector<PathStep> filtered(std::span<const PathStep> path, double tau_s);

/// A path without frame-to-frame jitter: positions from parabolas through those within `half_s`. A sensor's filter
/// averages such errors of the path, and would seem to explain readings better for that alone.
[[nodiscard]] std::vector<PathStep> without_jitter(std::span<const PathStep> path, double half_s);
constexpr double jitter_s = 0.4;

/// Position of a depth sensor in the camera's frame [m].
struct DepthArm {
  Eigen::Vector3d in_cam_m = Eigen::Vector3d::Zero();
  std::optional<double> sigma_m;  ///< Of each coordinate; it is then estimated. Empty: unknown, not included in σ.
};

/// depth = offset + g·r + down·R a with the camera's position r and rotation R, and the sensor's position a in the
/// camera; offset and direction are unknown, |g| is the scale. Its σ is from the residuals, which are autocorrelated,
/// and from `sigma_rel`, a common error of all readings. Outliers are rejected; a clock that is off by up to a second,
/// a low-pass filter, a jump or drift of the offset, and a wrong position of the sensor are detected in the residuals.
/// Empty: too little vertical motion, or the readings do not fit the path.
[[nodiscard]] std::optional<ReadScale> scale_by_depth(std::span<const DepthReading> readings, double sigma_rel,
                                                      std::span<const PathStep> path, const DepthArm& arm = {});

/// Each reading gives the scale at which the beam meets the plane through the map's points around it; the result is the
/// mean of all near the median, with σ from the scatter of blocks. If a score test is significant for a common offset,
/// a late clock or another beam direction, the one with which the readings agree best is estimated, too. Readings on
/// rough surfaces are rejected if most are on smooth ones. Empty: too few readings with points around them. Of two
/// surfaces, one behind the other, the one is met on which most readings agree. σ includes the covariance of the beam;
/// without one, 0.5 % of its scale.
[[nodiscard]] std::optional<ReadScale> scale_by_range(std::span<const RangeReading> readings, const Beam& beam,
                                                      std::span<const PathStep> path, std::span<const MapPoint> map);

/// Fits the vehicle's steps to the path's (odometry_steps.h), without outlier readings. σ is from the residuals,
/// `sigma_rel`, a common error of all readings, and the persistent residuals, beyond the path's σ, of a similarity of
/// each fifth of the way: slip lengthens all steps, planar odometry of a camera that leaves the plane shortens them. A
/// clock that is off by up to a second, and a filter, are found in the same way. Empty: too few readings, hardly any
/// motion, or readings that do not fit the path.
[[nodiscard]] std::optional<ReadScale> scale_by_odometry(std::span<const OdometryReading> readings, double sigma_rel,
                                                         std::span<const PathStep> path);

/// Evaluates each sensor of the config against `result.path`; fills `result.sensor_scales`.
void read_scales(const LocalizeConfig& config, std::span<const MapPoint> map, Localization& result);
/// Adds the scale that an IMU gave when the path was solved.
void add_imu_scale(const LocalizeConfig& config, Localization& result);
/// A sensor's scale against a target's: ln of their ratio, and its σ, including that of the target's points.
struct ScaleDifference {
  double log_ratio = 0.0, sigma = 1.0;
  [[nodiscard]] double sigmas() const { return std::abs(log_ratio) / sigma; }
};
[[nodiscard]] ScaleDifference difference_from_target(const SensorScale& sensor, double sigma_target_scale);
/// Relative σ of the scale from known points, with their individual covariances.
[[nodiscard]] double sigma_target_scale(std::span<const MapPoint> map);
/// If a sensor contradicts a target, which of them is wrong is unknown: the difference is added to the path's σ.
/// `sigma_scale`: of the target's size, as given.
void widen_by_contradictions(double sigma_scale, Localization& result);
constexpr double contradicts_from = 3.0;  ///< In σ.

/// Weighted mean of the scales of all sensors. Empty: none determines it.
[[nodiscard]] std::optional<ReadScale> scale_of(const Localization& result);

/// Scales path and map about the world's origin; the σ of the scale is added to theirs.
void apply_scale(const ReadScale& scale, Localization& result);

}  // namespace alidade
