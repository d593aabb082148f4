#include "alidade/loop/servo_scenario.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/estimation/config_error.h"
#include "alidade/geometry/degree.h"
#include "alidade/pantilt/rig.h"

namespace alidade {
namespace {

void add_number(FieldList& fields, std::string name, double& value, Limits limits) {
  fields.push_back({.name = std::move(name), .value = &value, .help = "", .limits = limits});
}

Limits angles(double min_deg, double max_deg) { return {degree * min_deg, degree * max_deg}; }

void add_target(FieldList& fields, TargetPath& path) {
  add_number(fields, "target.radius_m", path.radius_m, {0.0, 1e4});
  add_number(fields, "target.period_s", path.period_s, {1e-3, 1e6});
  add_number(fields, "target.jump_at_s", path.jump_at_s, {0.0, 1e6});
}

void add_axis(FieldList& fields, const std::string& name, ServoAxis& axis) {
  std::visit(
      [&](auto& plant) {
        add_number(fields, name + ".gain", plant.gain, {-1e6, 1e6});
        add_number(fields, name + ".tau_s", plant.tau_s, {1e-4, 100.0});
        add_number(fields, name + ".max_rate_rad_s", plant.max_rate_rad_s, angles(1e-3, 1e5));
        if constexpr (requires { plant.max_acceleration_rad_s2; })
          add_number(fields, name + ".max_acceleration_rad_s2", plant.max_acceleration_rad_s2, angles(1e-3, 1e7));
      },
      axis.plant);
  add_number(fields, name + ".command_delay_s", axis.command_delay_s, {0.0, 10.0});
  add_number(fields, name + ".dead_band", axis.dead_band, {0.0, 1e9});
  add_number(fields, name + ".backlash_rad", axis.backlash_rad, angles(0.0, 90.0));
  add_number(fields, name + ".second_tau_s", axis.second_tau_s, {0.0, 100.0});
}

void add_controllers(FieldList& fields, ServoConfig& config) {
  add_number(fields, "pi.kp", config.pi.kp, {-1e9, 1e9});
  add_number(fields, "pi.ki", config.pi.ki, {-1e9, 1e9});
  add_number(fields, "predictive.rate_gain_per_s", config.rate_gain_per_s, {0.0, 1e4});
  add_number(fields, "predictive.command_weight", config.command_weight, {1e-6, 1e6});
  add_number(fields, "predictive.range_m", config.range_m, {1e-3, 1e6});
  add_number(fields, "predictive.sigma_px", config.sigma_px, {1e-3, 1e3});
  add_number(fields, "predictive.sigma_encoder_rad", config.sigma_encoder_rad, {1e-6, degree * 90.0});
  BearingFilterConfig& filter = config.filter;
  add_number(fields, "filter.singer_tau_s", filter.singer_tau_s, {1e-2, 1e3});
  add_number(fields, "filter.memory_s", filter.memory_s, {1e-3, 1e3});
  add_number(fields, "filter.start_rate_rad_s", filter.start_rate_rad_s, angles(1e-3, 1e5));
  add_number(fields, "filter.gate", filter.gate, {1.0, 1e9});
  for (double& sigma : filter.sigma_rad_s2)
    add_number(fields, "filter.sigma_rad_s2", sigma, {0.0, degree * 1e7, /*is_above_min=*/true});
  SearchConfig& search = config.search;
  add_number(fields, "search.coast_s", search.coast_s, {0.0, 1e3});
  add_number(fields, "search.carry_s", search.carry_s, {0.0, 1e3});
  add_number(fields, "search.speed_rad_s", search.speed_rad_s, angles(1e-3, 1e4));
  add_number(fields, "search.turn_of_view", search.turn_of_view, {0.05, 10.0});
  add_number(fields, "search.max_radius_rad", search.max_radius_rad, angles(0.1, 360.0));
}

void add_scene(FieldList& fields, ServoScene& scene) {
  add_number(fields, "duration_s", scene.duration_s, {0.0, 3600.0});
  add_number(fields, "warm_up_s", scene.warm_up_s, {0.0, 3600.0});
  add_number(fields, "sample_period_s", scene.period_s, {1e-3, 1.0});
  add_number(fields, "latency_s", scene.latency_s, {0.0, 10.0});
  add_number(fields, "mismatch.gain", scene.mismatch.gain, {0.01, 100.0});
  add_number(fields, "mismatch.tau", scene.mismatch.tau, {0.01, 100.0});
  add_number(fields, "plant.sigma_gain", scene.plant_sigma.gain, {0.0, 1e6});
  add_number(fields, "plant.sigma_tau_s", scene.plant_sigma.tau_s, {0.0, 100.0});
  add_number(fields, "plant.sigma_command_delay_s", scene.plant_sigma.command_delay_s, {0.0, 10.0});
  add_number(fields, "noise.sigma_px", scene.sigma_px, {0.0, 1e3});
  add_number(fields, "noise.sigma_encoder_rad", scene.sigma_encoder_rad, angles(0.0, 90.0));
  add_number(fields, "noise.encoder_step_rad", scene.encoder_step_rad, angles(0.0, 90.0));
}

using Faults = std::vector<std::string>;

bool ascends(const std::vector<double>& t_s) {
  return std::ranges::all_of(t_s, [](double t) { return std::isfinite(t); }) &&
         std::ranges::adjacent_find(t_s, std::greater_equal<>()) == t_s.end();
}

void check_path(const TargetPath& path, Faults& found) {
  constexpr double max_m = 1e4;
  const auto is_near = [](const Eigen::Vector3d& point) { return point.cwiseAbs().maxCoeff() <= max_m; };
  if (path.kind < PathKind::still || path.kind > PathKind::recorded) found.emplace_back("target.path is none");
  if (!path.start_m.allFinite() || !is_near(path.start_m) || !path.jump_m.allFinite() || !is_near(path.jump_m))
    found.emplace_back("the target is further than 10 km");
  if (path.kind != PathKind::recorded) return;
  const bool is_whole = path.recorded_s.size() >= 2 && path.recorded_s.size() == path.recorded_m.size();
  if (!is_whole || !ascends(path.recorded_s) ||
      !std::ranges::all_of(path.recorded_m, [&](const auto& point) { return point.allFinite(); }))
    found.emplace_back("a recorded path has two positions or more, finite and in order of time");
}

void check_scene(const ServoScene& scene, Faults& found) {
  Rig rig;
  rig.heads = scene.heads;
  if (scene.heads.empty()) found.emplace_back("a scene has one head or more");
  if (const std::string of_rig = fault(rig); !of_rig.empty()) found.push_back(of_rig);
  const auto& factor = scene.rig_errors.factor;
  const bool is_factor = factor.empty() || (factor.size() == scene.heads.size() &&
                                            std::ranges::all_of(factor, [&](const Eigen::MatrixXd& of) {
                                              return of.allFinite() && of.cols() == factor.front().cols();
                                            }));
  if (!is_factor) found.emplace_back("rig_errors are not one finite factor per head");
  check_path(scene.path, found);
  for (const ServoAxis& axis : scene.axes) {
    if (std::visit([](const auto& plant) { return plant.gain == 0.0; }, axis.plant))
      found.emplace_back("plant.gain: is zero");
    if (!(axis.min_rad < axis.max_rad)) found.emplace_back("the stops of an axis: the lower one first");
  }
  const double late_s = std::max(scene.axes[0].command_delay_s, scene.axes[1].command_delay_s);
  if (late_s > (max_command_delay_periods + 1e-6) * scene.period_s)
    found.push_back(fmt::format("command_delay_s: {} is more than {} periods of {} s: lengthen sample_period_s", late_s,
                                max_command_delay_periods, scene.period_s));
  if (!(scene.duration_s > scene.warm_up_s))
    found.push_back(
        fmt::format("duration_s: {} is not longer than the warm-up of {} s", scene.duration_s, scene.warm_up_s));
  if (scene.latency_s > 200.0 * scene.period_s)
    found.push_back(fmt::format("latency_s: {} is more than 200 images late", scene.latency_s));
  for (const auto& [from, to] : scene.hidden_s)
    if (!(from < to)) found.push_back(fmt::format("hidden_s: {} is not before {}", from, to));
  const ZoomProfile& zoom = scene.zoom;
  if (zoom.t_s.size() != zoom.factor.size() || !ascends(zoom.t_s) ||
      !std::ranges::all_of(zoom.factor, [](double of) { return of >= 0.01 && of <= 100.0; }))
    found.emplace_back("zoom: ascending times, and as many factors between 0.01 and 100");
  if (scene.intrinsics < LensKnowledge::given || scene.intrinsics > LensKnowledge::truth)
    found.emplace_back("intrinsics is none of given, observed, true");
  if (scene.background_points < 4 || scene.background_points > 200)
    found.emplace_back("background_points is not between 4 and 200");
}

}  // namespace

FieldList fields_of(ServoScenario& scenario) {
  FieldList fields;
  add_target(fields, scenario.scene.path);
  add_axis(fields, "plant", scenario.scene.axes[0]);
  add_axis(fields, "plant of tilt", scenario.scene.axes[1]);
  add_controllers(fields, scenario.config);
  add_scene(fields, scenario.scene);
  fields.push_back({.name = "seeds", .value = &scenario.num_seeds, .help = "", .limits = {1, 1000}});
  add_number(fields, "specification_px", scenario.specification_px, {1e-3, 1e6});
  if (!scenario.robustness) return fields;
  RobustnessConfig& grid = *scenario.robustness;
  const Limits factor{0.0, 100.0, /*is_above_min=*/true};
  add_number(fields, "robustness.gain", grid.gain_low, factor);
  add_number(fields, "robustness.gain", grid.gain_high, factor);
  add_number(fields, "robustness.tau", grid.tau_low, factor);
  add_number(fields, "robustness.tau", grid.tau_high, factor);
  fields.push_back({.name = "robustness.points", .value = &grid.points, .help = "", .limits = {1, 50}});
  return fields;
}

void require_sense(ServoScenario scenario) {
  FieldList fields = fields_of(scenario);
  // An angle plant may have no limit of its rate and acceleration.
  const bool is_angle = std::holds_alternative<AnglePlant>(scenario.scene.axes[0].plant);
  std::erase_if(fields, [is_angle](const Field& field) {
    double* const* number = std::get_if<double*>(&field.value);
    const bool may_be_none =
        field.name.ends_with("max_rate_rad_s") || (is_angle && field.name.ends_with("max_acceleration_rad_s2"));
    return may_be_none && number != nullptr && **number > 0.0 && std::isinf(**number);
  });
  Faults found = faults_of(fields);
  check_scene(scenario.scene, found);
  const std::vector<ControllerKind>& kinds = scenario.controllers;
  if (kinds.empty()) found.emplace_back("controllers: names none");
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    if (std::ranges::count(controller_kinds, kinds[i]) == 0) found.emplace_back("controllers: one is none of the enum");
    if (std::ranges::count(kinds, kinds[i]) > 1) found.emplace_back("controllers: one appears twice");
  }
  if (!found.empty()) throw ConfigError(fmt::format("{}", fmt::join(found, "; ")));
}

}  // namespace alidade
