#include "alidade/heads/follow_forecast.h"

#include <algorithm>
#include <cmath>

#include "alidade/servo.h"

namespace alidade {
namespace {

constexpr double sigma_px = 0.3;

/// Where the target was, far away: bearings alone were seen.
TargetPath path_of(const HeadFollowing& following, const RigHead& rig_head) {
  TargetPath path{.kind = PathKind::recorded};
  for (const FollowedFrame& frame : following.frames) {
    const auto ray = frame.is_found ? ray_in_world(rig_head, frame.pan_tilt_rad, frame.px) : std::nullopt;
    if (!ray || (!path.recorded_s.empty() && frame.t_s <= path.recorded_s.back())) continue;
    path.recorded_s.push_back(frame.t_s);
    path.recorded_m.emplace_back(ray->origin_in_world + follow_range_m * ray->direction_in_world);
  }
  return path;
}

/// What `servo` is to know of the axes, within these angles.
ServoConfig servo_config(const HeadFollowConfig& config, const HeadRange& within, double period_s) {
  ServoConfig servo{.period_s = period_s, .sigma_px = sigma_px, .range_m = follow_range_m};
  servo.filter.gate = follow_gate;
  servo.pi = {.kp = 0.0, .ki = 1.0, .unit = ErrorUnit::rad};
  servo.sigma_encoder_rad = std::max(1e-5, config.resolution_rad);
  servo.search.enabled = false;
  servo.search.coast_s = 1.0;
  for (std::size_t i = 0; i < 2; ++i) {
    const PositionerParams& axis = config.axes[i];
    const auto k = static_cast<Eigen::Index>(i);
    servo.axes[i].plant =
        AnglePlant{1.0, AngleUnit::rad, axis.time_constant_s, axis.rate_rad_s, axis.acceleration_rad_s2};
    servo.axes[i].min_rad = within.low_rad[k];
    servo.axes[i].max_rad = within.high_rad[k];
    servo.axes[i].command_delay_s = axis.latency_s;
  }
  return servo;
}

}  // namespace

std::optional<FollowForecast> forecast_of(const HeadFollowing& following, const RigHead& rig_head,
                                          const HeadFollowConfig& config, const HeadRange& within) {
  constexpr double min_s = 2.0, settled_share = 1.0 / 3.0;
  ServoScenario scenario;
  ServoScene& scene = scenario.scene;
  scene.path = path_of(following, rig_head);
  if (scene.path.recorded_s.size() < 10) return std::nullopt;
  const double begin_s = scene.path.recorded_s.front(), duration_s = scene.path.recorded_s.back() - begin_s;
  if (duration_s < min_s) return std::nullopt;
  for (double& t_s : scene.path.recorded_s) t_s -= begin_s;
  scenario.config = servo_config(config, within, following.period_s);
  scene.heads = {rig_head};
  scene.heads[0].head.encoder.sigma_rad = 0.0;
  scene.axes = scenario.config.axes;
  scene.duration_s = duration_s;
  scene.warm_up_s = settled_share * duration_s;
  scene.period_s = following.period_s;
  // `servo` takes its images when it sends commands: what is left of an image's age is late at the other end.
  scene.latency_s = following.period_s * std::floor(following.image_age_s / following.period_s);
  for (ServoAxis& axis : scene.axes) axis.command_delay_s += following.image_age_s - scene.latency_s;
  scene.sigma_px = sigma_px;
  scene.sigma_encoder_rad = 0.0;
  scene.encoder_step_rad = config.resolution_rad;
  scenario.controllers = {ControllerKind::feedforward, ControllerKind::lqr, ControllerKind::mpc};
  scenario.num_seeds = 2;
  scenario.robustness.reset();
  const ServoResult predicted = servo(scenario);
  if (predicted.comparison.empty()) return std::nullopt;
  const auto best = std::ranges::min_element(predicted.comparison, {},
                                             [](const ServoComparison& each) { return each.figures.rms_px; });
  return FollowForecast{.controller = best->controller,
                        .rms_px = best->figures.rms_px,
                        .period_s = scene.period_s,
                        .image_age_s = following.image_age_s,
                        .command_delay_s = scenario.config.axes[0].command_delay_s};
}

}  // namespace alidade
