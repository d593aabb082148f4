#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/similarity.h"
#include "alidade/localize/checks/scale_readings.h"

// Odometry's scale, and what all sensors say together.

#include "alidade/estimation/median.h"

namespace alidade {
namespace {

/// Where the camera and the vehicle were at a time.
struct Place {
  Eigen::Vector3d of_path, of_vehicle;
  double way_m = 0.0;          ///< By odometry, since the first.
  double path_variance = 0.0;  ///< Of the path's position, all three axes.
};

/// At the times of the readings, by a clock that is late by so much.
std::vector<Place> places_of(std::span<const OdometryReading> readings, double late_s, std::span<const PathStep> path) {
  std::vector<Place> places;
  for (const OdometryReading& reading : readings) {
    const auto pose = pose_at(path, reading.t_s - late_s);
    if (!pose) continue;
    Place place{pose->translation, reading.position_m, 0.0, position_cov_at(path, reading.t_s - late_s).trace()};
    if (!places.empty()) place.way_m = places.back().way_m + (place.of_vehicle - places.back().of_vehicle).norm();
    places.push_back(place);
  }
  return places;
}

/// Sums of squares over some places.
struct PartFit {
  double extent_m2 = 0.0;   ///< Of the vehicle's from their middle.
  double of_path_m2 = 0.0;  ///< Of what the path's σ explains of what is left over.
};

/// What is left over of a similarity of some places, in metres, and of those along a line of their distances on it.
std::vector<Eigen::Vector3d> left_over(std::span<const Place> places, PartFit& part) {
  std::vector<Eigen::Vector3d> of_path, of_vehicle, left;
  Eigen::Vector3d middle_of_path = Eigen::Vector3d::Zero(), middle = Eigen::Vector3d::Zero();
  for (const Place& place : places) {
    of_path.push_back(place.of_path);
    of_vehicle.push_back(place.of_vehicle);
    middle_of_path += place.of_path / static_cast<double>(places.size());
    middle += place.of_vehicle / static_cast<double>(places.size());
  }
  const auto there = aligned(of_path, of_vehicle, false);
  const Eigen::Vector3d along_path = (of_path.back() - of_path.front()).normalized();
  const Eigen::Vector3d along = (of_vehicle.back() - of_vehicle.front()).normalized();
  double products = 0.0, squares = 0.0, extent_of_path = 0.0, path_variances = 0.0;
  for (const Place& place : places) {
    const double x = along_path.dot(place.of_path - middle_of_path);
    products += x * along.dot(place.of_vehicle - middle);
    squares += x * x;
    part.extent_m2 += (place.of_vehicle - middle).squaredNorm();
    extent_of_path += (place.of_path - middle_of_path).squaredNorm();
    path_variances += place.path_variance;
  }
  if (extent_of_path > 0.0) part.of_path_m2 = path_variances * part.extent_m2 / extent_of_path;
  const double scale = squares > 0.0 ? products / squares : 0.0;
  for (const Place& place : places)
    left.push_back(there ? place.of_vehicle -
                               (there->scale * (there->b_from_a.rotation * place.of_path) + there->b_from_a.translation)
                         : Eigen::Vector3d((along.dot(place.of_vehicle - middle) -
                                            scale * along_path.dot(place.of_path - middle_of_path)) *
                                           along));
  return left;
}

/// How a path fits odometry, fifth by fifth of the way: odometry's frame turns with its errors.
struct WayFit {
  double misfit_m2 = std::numeric_limits<double>::infinity();  ///< Mean square of what is left over.
  double persistent = 1.0;     ///< RMS of what of that is persistent, over that of the vehicle's places.
  double num_independent = 1;  ///< As many readings determine as much.
};

WayFit way_fit(std::span<const Place> places) {
  constexpr std::size_t most_parts = 5, readings_each = 10, enough = 5;
  const std::size_t num_parts = std::clamp(places.size() / readings_each, std::size_t{1}, most_parts);
  double extent = 0.0, alike = 0.0, persistent = 0.0, squares = 0.0, num = 0.0;
  const auto part_of = [&](std::size_t i) {
    const double share = places[i].way_m / places.back().way_m;
    return std::min(static_cast<std::size_t>(static_cast<double>(num_parts) * share), num_parts - 1);
  };
  for (std::size_t begin = 0, end = 0; begin < places.size(); begin = end) {
    while (end < places.size() && part_of(end) == part_of(begin)) ++end;
    if (end - begin < enough) continue;
    PartFit part;
    const std::vector<Eigen::Vector3d> left = left_over(places.subspan(begin, end - begin), part);
    extent += part.extent_m2;
    const double here = static_cast<double>(left.size());
    // seven numbers of three coordinates each
    const double freed = 3.0 * here / (3.0 * here - 7.0);
    const double of_part = here * freed * persistent_square(left);
    alike += of_part;
    persistent += std::max(of_part - part.of_path_m2, 0.0);
    for (const Eigen::Vector3d& each : left) squares += freed * each.squaredNorm();
    num += here;
  }
  if (!(extent > 0.0)) return {};
  const double correlation = squares > 0.0 ? std::clamp(alike / squares, 0.0, 0.98) : 0.0;
  return {squares / num, std::sqrt(persistent / extent), num * (1.0 - correlation) / (1.0 + correlation)};
}

/// How far a path leaves the plane that it is nearest to, over all of it: to an odometry of two coordinates that is
/// lost.
double out_of_plane(std::span<const Place> places) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Place& place : places) middle += place.of_path / static_cast<double>(places.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Place& place : places) scatter += (place.of_path - middle) * (place.of_path - middle).transpose();
  const Eigen::Vector3d squares = symmetric_eigen3(scatter).values;
  return squares.sum() > 0.0 ? std::sqrt(std::max(squares[0], 0.0) / squares.sum()) : 0.0;
}

/// How late odometry's clock is, where that explains clearly more than no offset: the least of a parabola through the
/// best of a grid.
double clock_of(std::span<const OdometryReading> readings, std::span<const PathStep> path) {
  constexpr double step_s = 0.05, clear = 12.0;  // of χ², 3.5σ
  constexpr int most = 20;
  std::array<WayFit, 2 * most + 1> fits;
  for (int i = -most; i <= most; ++i) {
    const std::vector<Place> places = places_of(readings, step_s * i, path);
    if (!places.empty() && places.back().way_m > 0.0) fits[static_cast<std::size_t>(i + most)] = way_fit(places);
  }
  const auto best = static_cast<std::size_t>(std::ranges::min_element(fits, {}, &WayFit::misfit_m2) - fits.begin());
  if (best == 0 || best + 1 == fits.size()) return 0.0;
  const double before = fits[best - 1].misfit_m2, least = fits[best].misfit_m2, after = fits[best + 1].misfit_m2;
  if (!std::isfinite(before + after)) return 0.0;
  if (!(fits[most].misfit_m2 - least > clear * least / fits[best].num_independent)) return 0.0;
  const double curve = before - 2.0 * least + after;
  const double share = curve > 0.0 ? 0.5 * (before - after) / curve : 0.0;
  return step_s * (static_cast<double>(best) - most + std::clamp(share, -1.0, 1.0));
}

/// The straight ways, as logarithms of odometry's over the path's, without those far from all others.
struct Ways {
  double mean = 0.0, sigma = 0.0;
  std::size_t num_given = 0, num_used = 0;
};
std::optional<Ways> ways_of(std::span<const Place> places) {
  constexpr double num_ways = 20.0;
  constexpr std::size_t enough = 10;
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
  Ways ways{.num_given = logs.size()};
  constexpr double rejected_beyond = 4.0;  // of their robust σ
  const double centre = median_of(logs);
  std::vector<double> sizes;
  for (const double log : logs) sizes.push_back(std::abs(log - centre));
  const double limit = rejected_beyond * normal_from_mad * median_of(std::move(sizes)) + 1e-9;
  std::erase_if(logs, [&](double log) { return std::abs(log - centre) > limit; });
  double sum = 0.0, squares = 0.0;
  for (const double log : logs) sum += log;
  const double num = static_cast<double>(logs.size());
  ways.mean = sum / num;
  for (const double log : logs) squares += (log - ways.mean) * (log - ways.mean);
  ways.sigma = std::sqrt(squares / (num * (num - 1.0)));
  ways.num_used = logs.size();
  return ways;
}

/// A time constant and a clock of odometry, how the path as it shows it fits, and its ways.
struct Followed {
  double tau_s = 0.0, late_s = 0.0;
  WayFit fit;
  Ways ways;
  std::vector<Place> places;
};

std::optional<Followed> followed(std::span<const OdometryReading> readings, double tau_s, double late_s,
                                 std::span<const PathStep> shown) {
  Followed one{.tau_s = tau_s, .late_s = late_s, .places = places_of(readings, late_s, shown)};
  const auto ways = ways_of(one.places);
  if (!ways) return std::nullopt;
  one.ways = *ways;
  one.fit = way_fit(one.places);
  return std::isfinite(one.fit.misfit_m2) ? std::optional(std::move(one)) : std::nullopt;
}

/// Filters, and clocks beside them: a filter delays the way by its time constant, as a late clock does, and rounds its
/// turns off, as no clock does. One that is not of first order is like one with a delay; one of samples, whose newest
/// counts at once, is like one that is early by half of the time between two. Nothing is looked for where
/// the clock is right and neighbours err by themselves.
std::vector<Followed> filters_of(std::span<const OdometryReading> readings, const Followed& clock,
                                 std::span<const PathStep> path) {
  constexpr double first_s = 0.05, last_s = 1.5, ratio = 1.15, step_s = 0.05, alike = 3.0;
  constexpr int most = 6;
  std::vector<Followed> filters;
  const double every_s =
      (readings.back().t_s - readings.front().t_s) / static_cast<double>(std::max<std::size_t>(readings.size() - 1, 1));
  const double earliest_s = -std::min(0.5 * every_s, most * step_s);
  const auto num = static_cast<double>(clock.places.size());
  if (clock.late_s == 0.0 && num < alike * clock.fit.num_independent) return filters;
  for (double tau_s = first_s; tau_s < last_s; tau_s *= ratio) {
    const std::vector<PathStep> shown = filtered(path, tau_s);
    for (int k = 0; k <= most; ++k)
      if (auto one = followed(readings, tau_s, earliest_s + k * step_s, shown)) filters.push_back(*std::move(one));
  }
  return filters;
}

/// What odometry says with a clock alone, or with a filter where that explains clearly more; each filter counts by its
/// likelihood, and their scatter is in σ.
Followed averaged(Followed clock, const std::vector<Followed>& filters) {
  constexpr double clear = 12.0;  // of χ², 3.5σ
  if (filters.empty()) return clock;
  const Followed& best =
      *std::ranges::min_element(filters, {}, [](const Followed& each) { return each.fit.misfit_m2; });
  const double least = std::min(best.fit.misfit_m2, clock.fit.misfit_m2), num = best.fit.num_independent;
  const auto chi2_of = [&](const Followed& each) { return num * (each.fit.misfit_m2 / least - 1.0); };
  double weights = 0.0, sum = 0.0, squares = 0.0;
  const auto add = [&](const Followed& each) {
    const double weight = std::exp(-0.5 * chi2_of(each)), log = each.ways.mean;
    weights += weight, sum += weight * log, squares += weight * log * log;
  };
  for (const Followed& each : filters) add(each);
  add(clock);
  Followed chosen = chi2_of(clock) > clear ? best : std::move(clock);
  chosen.ways.mean = sum / weights;
  chosen.ways.sigma =
      std::hypot(chosen.ways.sigma, std::sqrt(std::max(squares / weights - chosen.ways.mean * chosen.ways.mean, 0.0)));
  return chosen;
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
  auto clock = followed(readings, 0.0, clock_of(readings, path), path);
  if (!clock) return std::nullopt;
  const std::vector<Followed> filters = filters_of(readings, *clock, path);
  const Followed found = averaged(*std::move(clock), filters);
  const bool is_in_plane = std::ranges::all_of(
      readings, [&](const OdometryReading& each) { return each.position_m.z() == readings.front().position_m.z(); });
  const double lost = is_in_plane ? out_of_plane(found.places) : 0.0;
  ReadScale read{std::exp(found.ways.mean),
                 std::hypot(std::hypot(found.ways.sigma, found.fit.persistent, sigma_rel), lost),
                 found.ways.num_used,
                 found.ways.num_given - found.ways.num_used,
                 found.late_s,
                 0.0,
                 0.0,
                 0.0,
                 found.tau_s};
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
               read->offset_m,
               read->aside_rad,
               read->hidden_offset_rel,
               read->lag_s,
               read->scale * acceleration / config.filter.sigma_a_m_s2,
               read->jump_m,
               read->jump_s,
               read->other_log_scale};
    if (!result.has_target) {  // nothing says which
      scale.sigma_rel = read ? std::hypot(read->sigma_rel, 0.5 * read->other_log_scale) : 0.0;
      scale.other_log_scale = 0.0;
    }
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
  const double of_target = sensor.sensor == "IMU" ? 0.0 : sigma_target_scale;  // an IMU's has it
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
  }
}

}  // namespace alidade
