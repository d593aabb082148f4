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
       .help = "How much of a brown lens's distortion the filter knows"},
      {.name = "calibrate_online",
       .value = &config.calibrate_online,
       .help = "Estimate fx fy cx cy k1 k2 p1 p2 as well, from the camera file's values and σ on"},
      {.name = "new_points",
       .value = words_code(config.new_points, new_points),
       .help = "How a new point enters: inverse-depth, xyz, or delayed until its depth is known to 5 %"},
      {.name = "depth_m",
       .value = &config.depth_m,
       .help = "Depth first assumed for a new point [m] (default: the target's)",
       .limits = positive},
  };
}

FieldList sigma_fields(LocalizeConfig& config) {
  return {
      {.name = "sigma_depth", .value = &config.sigma_depth, .help = "σ of that depth, relative", .limits = positive},
      {.name = "sigma_px",
       .value = &config.sigma_px,
       .help =
           "σ of a pixel coordinate (default: of a table estimated from its tracks, 0.5 where they agree); in images, "
           "where each match brings its own, the least (default 0.11) [px]",
       .limits = positive,
       .option = "--sigma-px"},
      {.name = "sigma_scale",
       .value = &config.sigma_scale,
       .help = "σ of the target's size over it, as of a print (0.002: 0.2 %), counted",
       .limits = positive},
      {.name = "sigma_times_s",
       .value = &config.sigma_times_s,
       .help = "σ of the frames' times, the same error for all [s]: counted in each pose by the camera's velocity (0: "
               "exact, as where the frames themselves are the times); without it by how far an IMU's clock is off them",
       .limits = {.min = 0.0}},
      {.name = "sigma_a_m_s2",
       .value = &config.filter.sigma_a_m_s2,
       .help = "Acceleration of the camera [m/s2]; by hand about 4",
       .limits = positive},
      {.name = "sigma_alpha_rad_s2",
       .value = &config.filter.sigma_alpha_rad_s2,
       .help = "Angular acceleration [rad/s2]; by hand about 6",
       .limits = positive,
       .option = "--sigma-alpha"},
      {.name = "sigma_depth_sensor",
       .value = &config.sigma_depth_sensor,
       .help =
           "σ of the scale of --depth-sensor, relative: the density of the water, fresh or sea, and the sensor's own "
           "(0.01: 1 %)",
       .limits = positive},
      {.name = "depth_arm_m",
       .value = numbers_code(
           3,
           [&config] {
             const auto& arm = config.depth_arm_m;
             return arm ? std::vector<double>{arm->x(), arm->y(), arm->z()} : std::vector<double>{};
           },
           [&config](const std::vector<double>& arm) { config.depth_arm_m = Eigen::Vector3d(arm[0], arm[1], arm[2]); }),
       .help = "Where the sensor of --depth-sensor is, x,y,z in the camera's frame [m] (default: at its centre)",
       .form = "NUMBER"},
      {.name = "sigma_depth_arm_m",
       .value = &config.sigma_depth_arm_m,
       .help = "σ of each coordinate of that place [m]: it is estimated with the scale",
       .limits = positive},
      {.name = "sigma_odometry",
       .value = &config.sigma_odometry,
       .help = "σ of the scale of --odometry, relative, as of a wheel's radius (0.01: 1 %)",
       .limits = positive},
  };
}

}  // namespace

FieldList fields_of(LocalizeConfig& config) {
  FieldList fields = model_fields(config);
  for (Field& field : sigma_fields(config)) fields.push_back(std::move(field));
  fields.push_back({.name = "max_points",
                    .value = &config.max_points,
                    .help = "Points in the filter at once, beside the target's: when full, the least informative is "
                            "removed, and added again when it is seen again (0: as many as its state of 800 holds; in "
                            "images 120)",
                    .limits = {0.0, 3000.0}});
  return fields;
}

}  // namespace alidade
