#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

// Metres from what a vehicle has beside its camera: a pressure sensor, a rangefinder. A path up to scale, by so many
// times as long, is where they say that it is; a path in metres is checked by them.

namespace alidade {

struct ReadScale {
  double scale = 1.0;      ///< Metres for each unit of the path.
  double sigma_rel = 1.0;  ///< Its σ over it.
  std::size_t num_used = 0, num_rejected = 0;
  double late_s = 0.0;     ///< The readings' clock less the path's, where it is off.
  double offset_m = 0.0;   ///< By which a rangefinder reads too much, where it does.
  double aside_rad = 0.0;  ///< By which a rangefinder's beam points elsewhere, where it does.
  /// Share of the scale that 0.1 m too much of every reading would be, where it would not show; else 0.
  double hidden_offset_rel = 0.0;
  double lag_s = 0.0;                 ///< Time constant of the filter of a depth sensor or odometry, where it has one.
  double jump_m = 0.0, jump_s = 0.0;  ///< By which a depth sensor reads more from a time on, where it does.
  /// ln of another scale over this one, that at least half as many readings of a rangefinder have, of a surface before
  /// or behind; else 0.
  double other_log_scale = 0.0;
  double slip_from_s = 0.0, slip_to_s = 0.0, slip_ratio = 0.0;  ///< When odometry slips most, and by what factor.
  bool is_drifting = false;
  double drift_m = 0.0;  ///< By which the offset of a depth sensor has changed at the end, where it drifts.
  /// Where a depth sensor is in the camera's frame, with σ, where it is not where it was given; else 0.
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero(), sigma_arm_m = Eigen::Vector3d::Zero();
  double noise_factor = 1.0;  ///< RMS of what is left of a depth sensor's readings, over their σ.
  double arm_effect = 0.0;    ///< Change of ln scale where a depth sensor's place, given without σ, is 1 cm off.
};

/// The pose at a time, between the two frames around it. None outside the path, or where one of them has none.
[[nodiscard]] std::optional<Rigid3> pose_at(std::span<const PathStep> path, double t_s);

/// Covariance of the position at a time, in the world [the path's unit²]: of the frame at or after it.
[[nodiscard]] Eigen::Matrix3d position_cov_at(std::span<const PathStep> path, double t_s);

/// Mean square of what is alike in neighbours of what is left over of readings, in order of time: without half the mean
/// squared step between two, in the unit of `left`, squared. No number of readings averages that.
[[nodiscard]] double persistent_square(std::span<const Eigen::Vector3d> left);

/// Of a path what sensors are shown: where the camera is and how it is rotated, numbers that a filter averages each by
/// itself.
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
  /// By a filter of first order that has a time constant; nothing before it has forgotten its first value.
  [[nodiscard]] SensorPath filtered(double tau_s) const;
  /// Between the two frames around a time. None outside the path, or where one of them has none.
  [[nodiscard]] std::optional<Numbers> at(double t_s) const;
};

/// What a sensor with such a filter is shown of a path: positions.
[[nodiscard]] std::vector<PathStep> filtered(std::span<const PathStep> path, double tau_s);

/// A path without what differs from frame to frame: positions by parabolas through those within `half_s`. A filter
/// averages such errors of the path, and would seem to explain readings better for that alone.
[[nodiscard]] std::vector<PathStep> without_jitter(std::span<const PathStep> path, double half_s);
constexpr double jitter_s = 0.4;

/// Where a depth sensor is in the camera's frame [m].
struct DepthArm {
  Eigen::Vector3d in_cam_m = Eigen::Vector3d::Zero();
  std::optional<double> sigma_m;  ///< Of each coordinate, which is then estimated. None: not known, and not counted.
};

/// depth = offset + g·r + down·R a of the camera's position r and rotation R, and the sensor's place a in the camera:
/// of unknown offset and direction, |g| is the scale. Its σ is that of what is left over, whose neighbours in time are
/// alike, and `sigma_rel`, which all share. Readings far from all others are rejected; a clock that is up to a second
/// off, a filter, a jump or a drift of the offset, and another place than the given one are found by the residuals.
/// None: the path moves too little up and down, or the readings do not fit it.
[[nodiscard]] std::optional<ReadScale> scale_by_depth(std::span<const DepthReading> readings, double sigma_rel,
                                                      std::span<const PathStep> path, const DepthArm& arm = {});

/// Where the beam meets the plane through the map's points around it is `range_m` from its origin; the mean of all
/// readings near their median, with the scatter of blocks of them as its σ. Where a score test says clearly that all of
/// them are too long by one length, that their clock is late or that the beam points elsewhere, that of these without
/// which they agree best is estimated, too. Readings where points are off their plane do not count where most are on
/// it. None: too few readings with points around them. Of two surfaces one behind the other that is met which gives
/// most readings one scale. σ of the beam is in it; where its file has none, 0.5 % of its scale.
[[nodiscard]] std::optional<ReadScale> scale_by_range(std::span<const RangeReading> readings, const Beam& beam,
                                                      std::span<const PathStep> path, std::span<const MapPoint> map);

/// The vehicle's steps against the path's (odometry_steps.h), without readings far from those around them, with σ of
/// what is left over, `sigma_rel`, which all share, and what is persistently left over, beyond the path's σ, of a
/// similarity of each fifth of the way: slipping lengthens all steps, a plane in which the camera does not stay
/// shortens them. A clock that is up to a second off, and a filter, are found by the same. None: too few readings,
/// hardly a way, or readings that do not fit the path.
[[nodiscard]] std::optional<ReadScale> scale_by_odometry(std::span<const OdometryReading> readings, double sigma_rel,
                                                         std::span<const PathStep> path);

/// What each of the config's sensors says of `result.path`, into `result.sensor_scales`.
void read_scales(const LocalizeConfig& config, std::span<const MapPoint> map, Localization& result);
/// What an IMU said of it when the path was solved, into the same.
void add_imu_scale(const LocalizeConfig& config, Localization& result);
/// A sensor's scale against a target's: ln of their ratio, and its σ, that of where the target's points are included.
struct ScaleDifference {
  double log_ratio = 0.0, sigma = 1.0;
  [[nodiscard]] double sigmas() const { return std::abs(log_ratio) / sigma; }
};
[[nodiscard]] ScaleDifference difference_from_target(const SensorScale& sensor, double sigma_target_scale);
/// Of the scale by known points, relative, as sure as each is alone.
[[nodiscard]] double sigma_target_scale(std::span<const MapPoint> map);
/// Where a sensor contradicts a target, which of them is wrong is not known: the difference is in the path's σ.
/// `sigma_scale`: of the target's size, as given.
void widen_by_contradictions(double sigma_scale, Localization& result);
constexpr double contradicts_from = 3.0;  ///< In σ.

/// All of them together, the surer one counting for more. None: nothing determines it.
[[nodiscard]] std::optional<ReadScale> scale_of(const Localization& result);

/// Path and map, longer by the scale about the world's origin; its σ is added to theirs.
void apply_scale(const ReadScale& scale, Localization& result);

}  // namespace alidade
