#include "alidade/localize/config.h"

namespace alidade {
namespace {

constexpr Limits positive{.min = 0.0, .is_above_min = true};

FieldList model_fields(LocalizeConfig& config) {
  static const WordList<NewPoints> new_points = {
      {NewPoints::inverse_depth, "inverse-depth"}, {NewPoints::xyz, "xyz"}, {NewPoints::delayed, "delayed"}};
  return {
      {.name = "distortion",
       .value = words_code(config.distortion, distortion_words()),
       .help = "Distortion that the filter models for a brown lens"},
      {.name = "calibrate_online",
       .value = &config.calibrate_online,
       .help = "Also estimate fx fy cx cy k1 k2 p1 p2, starting from the camera file's values and σ"},
      {.name = "new_points",
       .value = words_code(config.new_points, new_points),
       .help = "Initialisation of a new point: inverse-depth, xyz, or delayed until its depth is known to 5 %"},
      {.name = "depth_m",
       .value = &config.depth_m,
       .help = "Initial depth of a new point [m] (default: the target's)",
       .limits = positive},
  };
}

FieldList sigma_fields(LocalizeConfig& config) {
  return {
      {.name = "sigma_depth", .value = &config.sigma_depth, .help = "Relative σ of that depth", .limits = positive},
      {.name = "sigma_px",
       .value = &config.sigma_px,
       .help = "σ of a pixel coordinate [px] (default: for tables estimated from the tracks, or 0.5 if they agree with "
               "it); for images the lower bound on each match's own σ (default 0.11)",
       .limits = positive,
       .option = "--sigma-px"},
      {.name = "sigma_scale",
       .value = &config.sigma_scale,
       .help = "Relative σ of the target's size, for example of a print (0.002: 0.2 %), included in the result's σ",
       .limits = positive},
      {.name = "sigma_times_s",
       .value = &config.sigma_times_s,
       .help = "σ of a time error shared by all frames [s], included in each pose by the camera's velocity (0: exact, "
               "for example where frame times are the reference; default: with --imu, from the offset of its clock)",
       .limits = {.min = 0.0}},
      {.name = "sigma_a_m_s2",
       .value = &config.filter.sigma_a_m_s2,
       .help = "σ of the camera's acceleration [m/s2]; handheld about 4",
       .limits = positive},
      {.name = "sigma_alpha_rad_s2",
       .value = &config.filter.sigma_alpha_rad_s2,
       .help = "σ of the camera's angular acceleration [rad/s2]; handheld about 6",
       .limits = positive,
       .option = "--sigma-alpha"},
      {.name = "sigma_depth_sensor",
       .value = &config.sigma_depth_sensor,
       .help =
           "Relative σ of the scale of --depth-sensor: water density (fresh or sea) and the sensor itself (0.01: 1 %)",
       .limits = positive},
      {.name = "depth_arm_m",
       .value = numbers_code(
           3,
           [&config] {
             const auto& arm = config.depth_arm_m;
             return arm ? std::vector<double>{arm->x(), arm->y(), arm->z()} : std::vector<double>{};
           },
           [&config](const std::vector<double>& arm) { config.depth_arm_m = Eigen::Vector3d(arm[0], arm[1], arm[2]); }),
       .help = "Position of the depth sensor, x,y,z in the camera frame [m] (default: at the camera centre)",
       .form = "NUMBER"},
      {.name = "sigma_depth_arm_m",
       .value = &config.sigma_depth_arm_m,
       .help = "σ of each coordinate of --depth-arm [m]: the position is then estimated along with the scale",
       .limits = positive},
      {.name = "sigma_odometry",
       .value = &config.sigma_odometry,
       .help = "Relative σ of the scale of --odometry, for example of the wheel radius (0.01: 1 %)",
       .limits = positive},
  };
}

}  // namespace

FieldList fields_of(LocalizeConfig& config) {
  FieldList fields = model_fields(config);
  for (Field& field : sigma_fields(config)) fields.push_back(std::move(field));
  fields.push_back(
      {.name = "max_points",
       .value = &config.max_points,
       .help = "Maximum points in the filter besides the target's; when full, the least informative is removed, and "
               "added again when seen again (0: as many as a state of 800 holds; in images 120)",
       .limits = {0.0, 3000.0}});
  return fields;
}

}  // namespace alidade
