#include "alidade/localize/setup.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "alidade/camera/camera_fault.h"
#include "alidade/estimation/config_error.h"
#include "alidade/localize/filter/filter.h"
#include "alidade/localize/frames/image_localizer.h"
#include "alidade/localize/frames/known_map.h"

namespace alidade {
namespace {

using Sentences = std::vector<std::string>;

/// Prior σ of lens parameters that may be in the state: a stale calibration.
struct OnlineParameter {
  const char* name;
  double sigma;
};
constexpr std::array<OnlineParameter, 8> online{
    {{"fx", 8.0}, {"fy", 8.0}, {"cx", 6.0}, {"cy", 6.0}, {"k1", 0.05}, {"k2", 0.1}, {"p1", 0.02}, {"p2", 0.02}}};

/// Internal values that a user does not set: their names and limits.
FieldList inner_fields(LocalizeConfig& config) {
  constexpr Limits positive{.min = 0.0, .is_above_min = true}, share{0.0, 1.0}, from_zero{.min = 0.0};
  constexpr Limits count{1.0, 1e6}, size{0.0, 1e6};
  LocalizationFilterConfig& filter = config.filter;
  ImageFeatureConfig& features = config.features;
  return {
      {.name = "period_s", .value = &config.period_s, .limits = from_zero},
      {.name = "max_smoothed", .value = &config.max_smoothed, .limits = {10, 1e6}},
      {.name = "sigma_speed_m_s", .value = &config.sigma_speed_m_s, .limits = positive},
      {.name = "sigma_rate_rad_s", .value = &config.sigma_rate_rad_s, .limits = positive},
      {.name = "target.sigma_scale", .value = &config.target.sigma_scale, .limits = from_zero},
      {.name = "filter.sigma_px", .value = &filter.sigma_px, .limits = positive},
      {.name = "filter.sigma_new_px", .value = &filter.sigma_new_px, .limits = from_zero},
      {.name = "filter.max_iterations", .value = &filter.max_iterations, .limits = count},
      {.name = "filter.gate", .value = &filter.gate, .limits = positive},
      {.name = "filter.curvature_tolerance", .value = &filter.curvature_tolerance, .limits = from_zero},
      {.name = "filter.consensus_above", .value = &filter.consensus_above, .limits = share},
      {.name = "filter.max_rotation_rad", .value = &filter.max_rotation_rad, .limits = from_zero},
      {.name = "filter.linear_below", .value = &filter.linear_below, .limits = from_zero},
      {.name = "filter.sigma_scale", .value = &filter.sigma_scale, .limits = from_zero},
      {.name = "filter.state_capacity", .value = &filter.state_capacity, .limits = {motion_dim, 20000}},
      {.name = "filter.observations_capacity", .value = &filter.observations_capacity, .limits = {1, 20000}},
      {.name = "bank.splits", .value = &config.bank.splits, .limits = {1, 1000}},
      {.name = "bank.spread", .value = &config.bank.spread, .limits = from_zero},
      {.name = "bank.narrowed", .value = &config.bank.narrowed, .limits = positive},
      {.name = "bank.min_weight", .value = &config.bank.min_weight, .limits = from_zero},
      {.name = "bank.max_frames", .value = &config.bank.max_frames, .limits = size},
      {.name = "features.min_found", .value = &features.min_found, .limits = count},
      {.name = "features.max_tried", .value = &features.max_tried, .limits = {1, 5000}},
      {.name = "features.max_new", .value = &features.max_new, .limits = size},
      {.name = "features.max_features", .value = &features.max_features, .limits = {1, 3000}},
      {.name = "features.sigma_floor_px", .value = &features.sigma_floor_px, .limits = positive},
      {.name = "features.min_correlation", .value = &features.min_correlation, .limits = {-1.0, 1.0}},
      {.name = "features.min_found_share", .value = &features.min_found_share, .limits = share},
      {.name = "features.cell_px", .value = &features.cell_px, .limits = size},
      {.name = "features.near_share", .value = &features.near_share, .limits = from_zero},
      {.name = "features.near_rad", .value = &features.near_rad, .limits = from_zero},
  };
}

void add_faults(const Camera& camera, Sentences& found) {
  if (std::string of_camera = fault(camera); !of_camera.empty()) found.push_back(std::move(of_camera));
}

void add_faults(const LocalizeTarget& target, Sentences& found) {
  std::set<long> ids;
  for (const KnownPoint& point : target.points) {
    const std::string name = fmt::format("the target's point {}", point.id);
    if (!ids.insert(point.id).second) found.push_back(name + " appears twice");
    if (!point.point_in_world.allFinite()) found.push_back(name + " has a position that is not finite");
    if (!(point.sigma_m > 0.0) || !std::isfinite(point.sigma_m)) found.push_back(name + ": its sigma_m is not above 0");
  }
  if (target.rectangle_m && target.points.size() != 4) found.emplace_back("a rectangle has four points");
  if (target.board && num_points(*target.board) != static_cast<int>(target.points.size()))
    found.push_back(fmt::format("the target's board has {} points, but {} are given", num_points(*target.board),
                                target.points.size()));
  if (!target.patches.empty() && target.patches.size() != target.points.size())
    found.emplace_back("the target has patches, but not one per point");
  for (const GreyPatch& patch : target.patches) {
    const auto num =
        static_cast<std::size_t>(std::max(patch.width_px, 0)) * static_cast<std::size_t>(std::max(patch.height_px, 0));
    if (num == 0 || patch.grey.size() != num) found.emplace_back("a patch of the target is not of its size");
  }
}

void add_faults(const SavedMap& map, const LocalizeConfig& config, Sentences& found) {
  if (!config.target.points.empty()) found.emplace_back("a map and a target are given: both say the map's frame");
  std::set<long> ids;
  for (const SavedPoint& point : map.points) {
    const std::string name = fmt::format("the map's point {}", point.id);
    if (!ids.insert(point.id).second) found.push_back(name + " appears twice");
    if (!point.point_in_world.allFinite() || !point.cov.allFinite() || !(point.cov.diagonal().minCoeff() > 0.0))
      found.push_back(name + " has a position or covariance that is none");
    if (point.look && point.look->patch.grey.size() != ReferencePatch::area_px)
      found.push_back(name + " has a patch that is not of its size");
  }
  for (const SavedKeyframe& keyframe : map.keyframes)
    if (keyframe.thumbnail.grey.size() != Thumbnail{}.grey.size())
      found.emplace_back("a keyframe of the map is not of its size");
}

void add_faults(const LocalizeStart& start, Sentences& found) {
  const CameraMotion& motion = start.motion;
  const Rigid3& pose = motion.world_from_cam;
  if (!pose.translation.allFinite() || !(std::abs(pose.rotation.norm() - 1.0) < 1e-3))
    found.emplace_back("the start's pose must be finite, with a quaternion of length 1");
  if (!motion.velocity_in_world.allFinite() || !motion.rate_in_cam.allFinite())
    found.emplace_back("the start's speeds are not finite");
  if (!start.cov.allFinite() || !(start.cov.diagonal().minCoeff() >= 0.0))
    found.emplace_back("the start's covariance must be finite, with a diagonal not below 0");
  if (!(start.depth_m >= 0.0) || !std::isfinite(start.depth_m)) found.emplace_back("the start's depth_m is below 0");
  if (!(start.sigma_depth > 0.0) || !std::isfinite(start.sigma_depth))
    found.emplace_back("the start's sigma_depth is not above 0");
  std::set<long> ids;
  for (const GivenDepth& depth : start.depths) {
    if (!ids.insert(depth.id).second) found.push_back(fmt::format("the start gives point {} two depths", depth.id));
    const bool is_good = depth.depth_m > 0.0 && depth.sigma_rel > 0.0 && std::isfinite(depth.depth_m / depth.sigma_rel);
    if (!is_good) found.push_back(fmt::format("the depth of point {}, or its sigma, is not above 0", depth.id));
  }
}

void add_faults(const Imu& imu, Sentences& found) {
  double last_t_s = -std::numeric_limits<double>::infinity();
  for (const ImuReading& reading : imu.readings) {
    if (!(reading.t_s > last_t_s) || !reading.rate_rad_s.allFinite() || !reading.force_m_s2.allFinite()) {
      found.emplace_back("a reading of the IMU is not finite, or not after the one before it");
      break;
    }
    last_t_s = reading.t_s;
  }
  const ImuNoise& noise = imu.noise;
  for (const double sigma :
       {noise.rate_density, noise.force_density, noise.rate_walk, noise.force_walk, noise.sigma_rate_bias,
        noise.sigma_force_bias, noise.sigma_force_scale, noise.sigma_axes, imu.gravity_m_s2, imu.sigma_gravity_m_s2})
    if (!(sigma > 0.0) || !std::isfinite(sigma)) {
      found.emplace_back("gravity, a density of the IMU's noise or a sigma of it is not above 0");
      break;
    }
  if (!imu.mounting) return;
  const Rigid3& pose = imu.mounting->cam_from_imu;
  if (!pose.translation.allFinite() || !(std::abs(pose.rotation.norm() - 1.0) < 1e-3) ||
      !(imu.mounting->sigma_rotation_rad > 0.0) || !(imu.mounting->sigma_position_m > 0.0))
    found.emplace_back("the mounting of the IMU is none");
}

/// Faults of the list of estimated lens parameters.
void add_lens_faults(const LocalizationFilterConfig& filter, const Camera& camera, Sentences& found) {
  const std::vector<int>& indices = filter.lens_params;
  if (indices.size() != filter.sigma_lens_params.size())
    found.emplace_back("filter.lens_params and filter.sigma_lens_params are not of one length");
  const auto num = static_cast<int>(params(camera.lens).size());
  for (const int index : indices)
    if (index < 0 || index >= num || std::ranges::count(indices, index) > 1)
      found.push_back(
          fmt::format("filter.lens_params has {}; the lens has {} parameters, numbered from 0", index, num));
  for (const double sigma : filter.sigma_lens_params)
    if (!(sigma > 0.0) || !std::isfinite(sigma))
      found.emplace_back("a sigma of filter.sigma_lens_params is not above 0");
  if (filter.state_capacity < motion_dim + static_cast<int>(std::max(indices.size(), online.size())))
    found.emplace_back("filter.state_capacity has no room for the lens");
}

void throw_if_any(const Sentences& found) {
  if (!found.empty()) throw ConfigError(fmt::format("{}", fmt::join(found, "; ")));
}

void put_lens_in_state(const Camera& camera, LocalizationFilterConfig& filter) {
  const std::vector<std::string> names = param_names(camera.lens);
  filter.lens_params.clear();
  filter.sigma_lens_params.clear();
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (const OnlineParameter& parameter : online) {
      if (names[i] != parameter.name) continue;
      const auto at = static_cast<Eigen::Index>(i);
      const bool has_sigma = camera.cov.rows() > at && camera.cov(at, at) > 0.0;
      filter.lens_params.push_back(static_cast<int>(i));
      filter.sigma_lens_params.push_back(has_sigma ? std::sqrt(camera.cov(at, at)) : parameter.sigma);
    }
  }
}

/// Numbered points are used as a target; points from images are searched for.
void take_map(const SavedMap& map, bool is_of_images, LocalizeTarget& target) {
  const bool has_looks =
      std::ranges::any_of(map.points, [](const SavedPoint& point) { return point.look.has_value(); });
  if (is_of_images && !has_looks)
    throw ConfigError("the map is of numbered points: images need one that was made of images");
  if (!is_of_images && has_looks)
    throw ConfigError("the map was made of images: its points have no numbers that a table could name");
  if (!is_of_images) target.points = known_points(map);
}

/// Configuration for tens of matches per frame, with room for the maximum number of features.
LocalizationFilterConfig image_filter(const LocalizeConfig& config) {
  LocalizationFilterConfig filter = for_images(config.filter, config.features.sigma_floor_px);
  const auto num_known = static_cast<int>(config.map ? max_saved_at_once : config.target.points.size());
  filter.state_capacity =
      motion_dim + static_cast<int>(filter.lens_params.size()) + 3 * num_known + 6 * config.features.max_features + 8;
  filter.observations_capacity = config.features.max_tried + num_known;
  return filter;
}

void add_field_faults(const LocalizeConfig& config, Sentences& found) {
  LocalizeConfig copy = config;
  found = faults_of(fields_of(copy));
  for (const Field& field : fields_of(copy))
    if (const auto* code = std::get_if<TextCode>(&field.value);
        code != nullptr && !code->words.empty() && code->write().empty())
      found.push_back(fmt::format("{} is none of {}", field.name, form_text(field)));
  for (std::string& fault : faults_of(inner_fields(copy))) found.push_back(std::move(fault));
}

/// Faults of the readings of other sensors.
void add_reading_faults(const LocalizeConfig& config, Sentences& found) {
  if (!std::ranges::all_of(config.depth_readings, [](const DepthReading& reading) {
        return std::isfinite(reading.t_s + reading.depth_m) && reading.sigma_m > 0.0 && std::isfinite(reading.sigma_m);
      }))
    found.emplace_back("a depth reading is not finite, or its sigma_m is not above 0");
  if (!std::ranges::all_of(config.odometry_readings, [](const OdometryReading& reading) {
        return std::isfinite(reading.t_s) && reading.position_m.allFinite();
      }))
    found.emplace_back("an odometry reading is not finite");
  if (config.imu) add_faults(*config.imu, found);
  if (!std::ranges::all_of(config.range_readings, [](const RangeReading& reading) {
        return std::isfinite(reading.t_s) && reading.range_m > 0.0 && std::isfinite(reading.range_m);
      }))
    found.emplace_back("a range reading is not finite and above 0");
}

void add_faults(const ImageMask& mask, const Camera& camera, Sentences& found) {
  if (mask.width_px != camera.width_px || mask.height_px != camera.height_px ||
      mask.shows.size() != static_cast<std::size_t>(camera.width_px) * static_cast<std::size_t>(camera.height_px))
    found.push_back(
        fmt::format("the mask is {} × {} px and the camera's images are {} × {} px: give a mask of their size",
                    mask.width_px, mask.height_px, camera.width_px, camera.height_px));
  else if (std::none_of(mask.shows.begin(), mask.shows.end(), [](auto shown) { return shown != 0; }))
    found.emplace_back("the mask is black everywhere: it is white where the scene is shown");
}

}  // namespace

void require_sense(const LocalizeConfig& config, const Camera& camera) {
  Sentences found;
  add_field_faults(config, found);
  add_faults(camera, found);
  throw_if_any(found);
  add_faults(config.target, found);
  if (config.map) add_faults(*config.map, config, found);
  if (config.start) add_faults(*config.start, found);
  add_reading_faults(config, found);
  if (config.mask) add_faults(*config.mask, camera, found);
  if (!config.range_readings.empty() && !config.beam) found.emplace_back("range readings need a beam");
  if (config.beam)
    if (const std::string of_beam = fault(*config.beam); !of_beam.empty()) found.push_back(of_beam);
  add_lens_faults(config.filter, camera, found);
  throw_if_any(found);
}

void require_sense(const ObservationFrame& frame, double last_t_s) {
  const std::string name = fmt::format("frame {}", frame.frame);
  Sentences found;
  if (!std::isfinite(frame.t_s)) found.push_back(name + " has no time");
  if (frame.t_s <= last_t_s) found.push_back(name + " is not after the frame before it");
  std::vector<long> ids;
  for (const FeatureObservation& observation : frame.observations) {
    ids.push_back(observation.id);
    if (!observation.px.allFinite() || !(observation.sigma_px >= 0.0) || !std::isfinite(observation.sigma_px))
      found.push_back(fmt::format("{}: point {} is not finite", name, observation.id));
  }
  std::ranges::sort(ids);
  if (const auto twice = std::ranges::adjacent_find(ids); twice != ids.end())
    found.push_back(fmt::format("{}: point {} appears twice", name, *twice));
  throw_if_any(found);
}

void require_sense(std::span<const TimedPose> truth) {
  const TimedPose* last = nullptr;
  for (const TimedPose& pose : truth) {
    const Rigid3& at = pose.world_from_cam;
    if (!std::isfinite(pose.t_s) || !at.translation.allFinite() || !at.rotation.coeffs().allFinite())
      throw ConfigError("the truth has a pose that is not finite");
    if (last != nullptr && !(pose.t_s > last->t_s)) throw ConfigError("the truth is not in order of time");
    last = &pose;
  }
}

Camera known_camera(const Camera& camera, const LocalizeConfig& config) {
  auto known = with_distortion(camera, config.distortion);
  if (!known) throw ConfigError("--distortion: only a brown lens can be given less than full distortion");
  return *known;
}

LocalizeConfig resolved(LocalizeConfig config, const Camera& camera, bool is_of_images) {
  if (config.calibrate_online) put_lens_in_state(camera, config.filter);
  if (config.map) take_map(*config.map, is_of_images, config.target);
  if (config.start && config.start->depth_m > 0.0 && !config.depth_m) {
    config.depth_m = config.start->depth_m;
    config.sigma_depth = config.start->sigma_depth;
  }
  if (config.target.points.empty()) {
    config.filter.sigma_scale = 0.0;
  } else {
    config.filter.sigma_scale = config.sigma_scale.value_or(config.target.sigma_scale);
    config.target.is_scale_given = config.target.is_scale_given || config.sigma_scale;
  }
  if (config.max_points > 0) {
    config.features.max_features = config.max_points;
    config.filter.state_capacity = motion_dim + static_cast<int>(config.filter.lens_params.size()) +
                                   3 * static_cast<int>(config.target.points.size()) + 6 * config.max_points;
  }
  if (!is_of_images) {
    if (config.sigma_px) config.filter.sigma_px = *config.sigma_px;
    return config;
  }
  if (config.sigma_px) config.features.sigma_floor_px = *config.sigma_px;
  config.filter = image_filter(config);
  return config;
}

LocalizeConfig sized(LocalizeConfig config, std::span<const ObservationFrame> frames) {
  std::set<long> ids;
  std::size_t most = 1;
  for (const ObservationFrame& frame : frames) {
    for (const FeatureObservation& observation : frame.observations) ids.insert(observation.id);
    most = std::max(most, frame.observations.size());
  }
  for (const KnownPoint& point : config.target.points) ids.insert(point.id);
  if (config.map)
    for (const SavedPoint& point : config.map->points) ids.insert(point.id);
  constexpr std::size_t num_lens = 16, limit = 1 << 20;
  const std::size_t need = motion_dim + num_lens + 6 * ids.size() + 8;
  LocalizationFilterConfig& filter = config.filter;
  filter.state_capacity = std::min(filter.state_capacity, static_cast<int>(std::min(need, limit)));
  filter.observations_capacity = std::min(filter.observations_capacity, static_cast<int>(std::min(most, limit)));
  return config;
}

}  // namespace alidade
