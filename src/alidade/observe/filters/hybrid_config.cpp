#include "alidade/observe/solve/solve_once.h"

namespace alidade {

bool needs_depth(const RotationLog& log, const ObserveSetup& config) {
  return config.lever_m.has_value() || config.nuisances.lever || log.has_velocity;
}

RotatingCamera start_camera(const ObserveSetup& config, const PixelScale& scale) {
  RotatingCamera start;
  start.k = config.start ? scale.normalised_intrinsics(*config.start) : Eigen::Vector4d(1.3, 1.3, 0.0, 0.0);
  if (config.lever_m) start.lever_m = *config.lever_m;
  if (config.height_px > 0) start.image_height = config.height_px / scale.scale;
  return start;
}

std::optional<CommonPrior> said_prior(const ObserveSetup& config, const RotatingCamera& start) {
  if (!config.square_pixels && !config.fixed_centre) return std::nullopt;
  constexpr double held = 1e-7;
  CommonPrior prior(start);
  if (config.square_pixels) prior.sigma_aspect = held;
  if (config.fixed_centre) {
    prior.sigma_k.tail<2>().setConstant(held);
    prior.is_given_k[2] = prior.is_given_k[3] = true;
  }
  return prior;
}

std::vector<std::string> quantity_names(const CommonLayout& layout, const std::vector<RotationError>& errors) {
  std::vector<std::string> names{"fx", "fy", "cx", "cy"};
  if (layout.k1 >= 0) names.emplace_back("k1");
  if (layout.k2 >= 0) names.emplace_back("k2");
  if (layout.k3 >= 0) names.emplace_back("k3");
  if (layout.tangential >= 0) names.insert(names.end(), {"p1", "p2"});
  if (layout.mount >= 0) names.insert(names.end(), {"mount_x_rad", "mount_y_rad", "mount_z_rad"});
  if (layout.delay >= 0) names.emplace_back("delay_s");
  if (layout.lever >= 0) names.insert(names.end(), {"lever_x_m", "lever_y_m", "lever_z_m"});
  if (layout.shutter >= 0) names.emplace_back("shutter_s");
  if (layout.drift >= 0) names.emplace_back("focal_drift_per_s");
  if (layout.errors >= 0) {
    for (const RotationError& error : errors) names.push_back(error.quantity);
  }
  return names;
}

HybridConfig hybrid_config(const RotationLog& layout, const ObserveSetup& config, const PixelScale& scale) {
  HybridConfig hybrid;
  hybrid.num_points = layout.num_points;
  hybrid.scale = scale;
  hybrid.nuisances = config.nuisances;
  hybrid.with_depth = needs_depth(layout, config);
  hybrid.start = start_camera(config, scale);
  hybrid.start_is_given = config.start.has_value();
  hybrid.no_zoom = config.no_zoom;
  hybrid.prior = said_prior(config, hybrid.start);
  hybrid.sigma_px = config.sigma_px.value_or(0.0);
  hybrid.sigma_range_m = config.sigma_range_m;
  hybrid.range_point = layout.range_point;
  return hybrid;
}

AdjustConfig adjust_config_of(const RotationLog& log, const ObserveSetup& config, const RotatingCamera& start,
                              const PixelScale& scale) {
  AdjustConfig adjust;
  adjust.nuisances = config.nuisances;
  adjust.nuisances.rotation = config.rotation != RotationKnowledge::known;
  adjust.with_depth = needs_depth(log, config);
  adjust.sigma_px = config.sigma_px.value_or(0.0) / scale.scale;
  adjust.sigma_range_m = config.sigma_range_m;
  adjust.range_point = log.range_point;
  adjust.start = start;
  adjust.prior = said_prior(config, start);
  if (config.rotation == RotationKnowledge::free) {
    adjust.sigma_rotation_rad = std::numeric_limits<double>::infinity();
  } else if (log.source == RotationSource::rate) {
    adjust.sigma_rate_rad_per_s = config.sigma_rate_rad_per_s.value_or(1e-3);
  } else {
    adjust.sigma_rotation_rad = config.sigma_angle_rad.value_or(1e-4);
  }
  if (!config.start) adjust.other_starts = {0.7, 2.5, 5.0, 10.0};
  return adjust;
}

}  // namespace alidade
