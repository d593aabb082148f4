#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "alidade/localize/checks/scale_readings.h"
#include "alidade/localize/map/map_frame.h"

// The scale from all other sensors together.

namespace alidade {
namespace {

/// Of the path, in its unit: from differences of mean velocities of consecutive seconds, insensitive to noise.
double rms_acceleration(std::span<const PathStep> path) {
  if (path.empty()) return 0.0;
  constexpr double second = 1.0;
  double squares = 0.0, num = 0.0;
  double next_s = path.front().t_s + second;
  for (const PathStep& step : path) {
    const double t_s = step.t_s;
    if (t_s < next_s) continue;
    next_s = t_s + second;
    const auto before = pose_at(path, t_s - second), at = pose_at(path, t_s), after = pose_at(path, t_s + second);
    if (!before || !at || !after) continue;
    squares += (before->translation - 2.0 * at->translation + after->translation).squaredNorm();
    num += 1.0;
  }
  return num > 0.0 ? std::sqrt(squares / num) : 0.0;
}

void take_read(const ReadScale& read, SensorScale& scale) {
  scale.scale = read.scale;
  scale.sigma_rel = read.sigma_rel;
  scale.num_used = read.num_used;
  scale.num_rejected = read.num_rejected;
  scale.late_s = read.late_s;
  scale.offset_m = read.offset_m;
  scale.aside_rad = read.aside_rad;
  scale.hidden_offset_rel = read.hidden_offset_rel;
  scale.lag_s = read.lag_s;
  scale.jump_m = read.jump_m;
  scale.jump_s = read.jump_s;
  scale.other_log_scale = read.other_log_scale;
  scale.slip_from_s = read.slip_from_s;
  scale.slip_to_s = read.slip_to_s;
  scale.slip_ratio = read.slip_ratio;
  scale.is_drifting = read.is_drifting;
  scale.drift_m = read.drift_m;
  scale.arm_m = read.arm_m;
  scale.sigma_arm_m = read.sigma_arm_m;
  scale.arm_effect = read.arm_effect;
  scale.noise_factor = read.noise_factor;
}

/// Units in which readings are given by mistake; with a target each can be recognised.
void take_unit(SensorScale& scale) {
  constexpr double near = 0.1;
  constexpr std::array<std::pair<const char*, double>, 3> units{{{"cm", 100.0}, {"mm", 1000.0}, {"feet", 3.2808}}};
  for (const auto& [name, per_metre] : units) {
    if (std::abs(std::log(scale.scale / per_metre)) > near) continue;
    scale.unit = name;
    scale.scale /= per_metre;
    scale.acceleration /= per_metre;
  }
}

/// Detects a wrong unit of a sensor: with a target by the scale, without one by an implausible acceleration of the
/// camera. A path in such a scale fits nothing.
void check_unit(bool has_target, SensorScale& scale) {
  constexpr double too_fast = 10.0;
  if (!(scale.sigma_rel > 0.0)) return;
  if (has_target) return take_unit(scale);
  scale.is_too_fast = scale.acceleration > too_fast;
  if (scale.is_too_fast) scale.sigma_rel = 0.0;
}

}  // namespace

void read_scales(const LocalizeConfig& config, std::span<const MapPoint> map, Localization& result) {
  result.sensor_scales.clear();
  const double acceleration = rms_acceleration(result.path);
  const auto add = [&](const char* sensor, const auto& readings, const std::optional<ReadScale>& read) {
    SensorScale scale;
    scale.sensor = sensor;
    if (read) take_read(*read, scale);
    scale.acceleration = scale.scale * acceleration / config.filter.sigma_a_m_s2;
    scale.arm_given_m = config.depth_arm_m.value_or(Eigen::Vector3d::Zero()).norm();
    if (!result.has_target) {  // unknown which of the two
      scale.sigma_rel = read ? std::hypot(read->sigma_rel, 0.5 * read->other_log_scale) : 0.0;
      scale.other_log_scale = 0.0;
    }
    check_unit(result.has_target, scale);
    scale.is_in_time = std::ranges::any_of(readings, [&](const auto& reading) {
      return !result.path.empty() && reading.t_s >= result.path.front().t_s && reading.t_s <= result.path.back().t_s;
    });
    result.sensor_scales.push_back(scale);
  };
  if (!config.depth_readings.empty())
    add("depth sensor", config.depth_readings,
        scale_by_depth(config.depth_readings, config.sigma_depth_sensor, result.path,
                       {config.depth_arm_m.value_or(Eigen::Vector3d::Zero()), config.sigma_depth_arm_m}));
  if (!config.range_readings.empty() && config.beam)
    add("rangefinder", config.range_readings, scale_by_range(config.range_readings, *config.beam, result.path, map));
  if (!config.odometry_readings.empty())
    add("odometry", config.odometry_readings,
        scale_by_odometry(config.odometry_readings, config.sigma_odometry, result.path));
}

void add_imu_scale(const LocalizeConfig& config, Localization& result) {
  if (!config.imu) return;
  if (!result.imu) result.imu = ImuEstimate{.fault = ImuFault::unsettled};
  const ImuEstimate& imu = *result.imu;
  const bool is_used = imu.fault == ImuFault::none;
  SensorScale scale;
  scale.sensor = "IMU";
  if (is_used) scale.scale = imu.scale, scale.sigma_rel = imu.sigma_scale;
  scale.num_used = imu.num_steps;
  scale.num_rejected = imu.num_rejected;
  scale.is_in_time = imu.fault != ImuFault::other_time;
  result.sensor_scales.push_back(scale);
}

double sigma_target_scale(std::span<const MapPoint> map) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double num = 0.0, information = 0.0;
  for (const MapPoint& point : map)
    if (point.is_known) middle += point.point_in_world, num += 1.0;
  middle /= std::max(num, 1.0);
  for (const MapPoint& point : map)
    if (point.is_known && point.cov.trace() > 0.0)
      information += 3.0 * (point.point_in_world - middle).squaredNorm() / point.cov.trace();
  return information > 0.0 ? 1.0 / std::sqrt(information) : 0.0;
}

ScaleDifference difference_from_target(const SensorScale& sensor, double sigma_target_scale) {
  const double one = std::log(sensor.scale), other = one + sensor.other_log_scale;
  const double of_target = sensor.sensor == "IMU" ? 0.0 : sigma_target_scale;  // an IMU's σ includes it
  return {std::abs(other) < std::abs(one) ? other : one, std::hypot(sensor.sigma_rel, of_target)};
}

void widen_by_contradictions(double sigma_scale, Localization& result) {
  result.sigma_target_scale = std::hypot(sigma_target_scale(result.map), sigma_scale);
  double most = 0.0;
  for (const SensorScale& sensor : result.sensor_scales) {
    if (!(sensor.sigma_rel > 0.0)) continue;
    const ScaleDifference difference = difference_from_target(sensor, result.sigma_target_scale);
    if (difference.sigmas() > contradicts_from) most = std::max(most, std::abs(difference.log_ratio));
  }
  if (most > 0.0) apply_scale({.sigma_rel = most}, result);
}

std::optional<ReadScale> scale_of(const Localization& result) {
  double weights = 0.0, logs = 0.0;
  ReadScale all;
  for (const SensorScale& each : result.sensor_scales) {
    if (!(each.sigma_rel > 0.0)) continue;
    const double weight = 1.0 / (each.sigma_rel * each.sigma_rel);
    weights += weight;
    logs += weight * std::log(each.scale);
    all.num_used += each.num_used;
    all.num_rejected += each.num_rejected;
  }
  if (!(weights > 0.0)) return std::nullopt;
  all.scale = std::exp(logs / weights);
  all.sigma_rel = 1.0 / std::sqrt(weights);
  return all;
}

void apply_scale(const ReadScale& scale, Localization& result) {
  const double s = scale.scale, variance = scale.sigma_rel * scale.sigma_rel;
  Eigen::Vector<double, 6> to_metres = Eigen::Vector<double, 6>::Ones();
  to_metres.head<3>().setConstant(s);
  for (PathStep& step : result.path) {
    if (!step.has_pose()) continue;
    step.world_from_cam.translation *= s;
    step.cov = to_metres.asDiagonal() * step.cov * to_metres.asDiagonal();
    const Eigen::Vector3d place = step.world_from_cam.rotation.conjugate() * step.world_from_cam.translation;
    step.cov.topLeftCorner<3, 3>() += variance * place * place.transpose();
  }
  for (MapPoint& point : result.map) {
    point.point_in_world *= s;
    point.cov *= s * s;
    point.cov += variance * point.point_in_world * point.point_in_world.transpose();
    if (point.cov_in_map) *point.cov_in_map *= s * s;
  }
  std::optional<SavedFrame>& frame = result.saved_map.frame;
  if (frame) frame = scaled_frame(*frame, s, scale.sigma_rel);
}

}  // namespace alidade
