#include <algorithm>
#include <cmath>

#include "alidade/localize/checks/scale_readings.h"

// Odometry's scale, and what all sensors say together.

#include "alidade/estimation/median.h"

namespace alidade {
namespace {

/// Where the camera and the vehicle were at a time.
struct Place {
  Eigen::Vector3d of_path, of_vehicle;
  double way_m = 0.0;  ///< By odometry, since the first.
};

/// At the times of the readings.
std::vector<Place> places_of(std::span<const OdometryReading> readings, std::span<const PathStep> path) {
  std::vector<Place> places;
  for (const OdometryReading& reading : readings) {
    const auto pose = pose_at(path, reading.t_s);
    if (!pose) continue;
    Place place{pose->translation, reading.position_m, 0.0};
    if (!places.empty()) place.way_m = places.back().way_m + (place.of_vehicle - places.back().of_vehicle).norm();
    places.push_back(place);
  }
  return places;
}

/// Of the path, in its unit: differences of the mean rates of seconds one after the other, which noise hardly enters.
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

}  // namespace

std::optional<ReadScale> scale_by_odometry(std::span<const OdometryReading> readings, double sigma_rel,
                                           std::span<const PathStep> path) {
  constexpr double num_ways = 20.0;
  constexpr std::size_t enough = 10;
  const std::vector<Place> places = places_of(readings, path);
  if (places.size() < enough || !(places.back().way_m > 0.0)) return std::nullopt;
  std::vector<double> logs;
  std::size_t begin = 0;
  for (std::size_t i = 1; i < places.size(); ++i) {
    if (places[i].way_m - places[begin].way_m < places.back().way_m / num_ways) continue;
    const double by_path = (places[i].of_path - places[begin].of_path).norm();
    const double by_vehicle = (places[i].of_vehicle - places[begin].of_vehicle).norm();
    begin = i;
    if (by_path > 0.0 && by_vehicle > 0.0) logs.push_back(std::log(by_vehicle / by_path));
  }
  if (logs.size() < enough) return std::nullopt;
  const std::size_t num_given = logs.size();
  constexpr double rejected_beyond = 4.0;  // of their robust σ
  const double centre = median_of(logs);
  std::vector<double> sizes;
  for (const double log : logs) sizes.push_back(std::abs(log - centre));
  const double limit = rejected_beyond * normal_from_mad * median_of(std::move(sizes)) + 1e-9;
  std::erase_if(logs, [&](double log) { return std::abs(log - centre) > limit; });
  double sum = 0.0, squares = 0.0;
  for (const double log : logs) sum += log;
  const double num = static_cast<double>(logs.size()), mean = sum / num;
  for (const double log : logs) squares += (log - mean) * (log - mean);
  const double of_ways = std::sqrt(squares / (num * (num - 1.0)));
  ReadScale read{std::exp(mean), std::hypot(of_ways, sigma_rel), logs.size(), num_given - logs.size()};
  constexpr double useless = 0.2;
  return read.sigma_rel < useless ? std::optional(read) : std::nullopt;
}

void read_scales(const LocalizeConfig& config, std::span<const MapPoint> map, Localization& result) {
  result.sensor_scales.clear();
  const double acceleration = rms_acceleration(result.path);
  const auto add = [&](const char* sensor, const auto& readings, const std::optional<ReadScale>& read) {
    SensorScale scale{sensor};
    if (read)
      scale = {sensor,
               read->scale,
               read->sigma_rel,
               read->num_used,
               read->num_rejected,
               true,
               read->late_s,
               read->scale * acceleration / config.filter.sigma_a_m_s2};
    scale.is_in_time = std::ranges::any_of(readings, [&](const auto& reading) {
      return !result.path.empty() && reading.t_s >= result.path.front().t_s && reading.t_s <= result.path.back().t_s;
    });
    result.sensor_scales.push_back(scale);
  };
  if (!config.depth_readings.empty())
    add("depth sensor", config.depth_readings,
        scale_by_depth(config.depth_readings, config.sigma_depth_sensor, result.path));
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
  result.sensor_scales.push_back({"IMU", is_used ? imu.scale : 1.0, is_used ? imu.sigma_scale : 0.0, imu.num_steps,
                                  imu.num_rejected, imu.fault != ImuFault::other_time});
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
  }
}

}  // namespace alidade
