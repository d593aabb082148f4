#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "alidade/localize/checks/judge.h"

namespace alidade {
namespace {

constexpr double ordinary_focal = 0.003, ordinary_centre_px = 2.0, ordinary_scale = 0.002, ordinary_clock_s = 0.001;
constexpr double ordinary_water = 0.003;  // fresh or salt, warm or cold
constexpr double ordinary_gap_m = 0.002, ordinary_normal = 0.005;
constexpr const char* remedy_port =
    "calibrate lens and port together, in this water (alidade calibrate --model flat_port)";
constexpr const char* remedy_camera = "use a camera file with its covariance (alidade calibrate writes one)";

struct Named {
  std::string_view given;
  const char* name;
  double ordinary;
};
constexpr std::array<Named, 9> all_named{{{"focal length", "camera.f (relative)", ordinary_focal},
                                          {"centre u", "camera.cx", ordinary_centre_px},
                                          {"centre v", "camera.cy", ordinary_centre_px},
                                          {"scale of the target", "target.scale", ordinary_scale},
                                          {"clock", "times (s)", ordinary_clock_s},
                                          {"water's index", "camera.n_water", ordinary_water},
                                          {"port's gap", "camera.gap_m", ordinary_gap_m},
                                          {"port's normal x", "camera.normal_x", ordinary_normal},
                                          {"port's normal y", "camera.normal_y", ordinary_normal}}};

/// Lens parameters by the names of given numbers.
constexpr std::array<std::pair<std::string_view, std::string_view>, 6> lens_names{{{"centre u", "cx"},
                                                                                   {"centre v", "cy"},
                                                                                   {"water's index", "n_water"},
                                                                                   {"port's gap", "gap_m"},
                                                                                   {"port's normal x", "normal_x"},
                                                                                   {"port's normal y", "normal_y"}}};

double value_of(std::string_view given, const Camera& camera) {
  if (given == "scale of the target") return 1.0;
  if (given == "clock") return 0.0;
  const Eigen::VectorXd lens = params(camera.lens);
  const auto named = std::ranges::find(lens_names, given, &std::pair<std::string_view, std::string_view>::first);
  if (named == lens_names.end()) return lens[0];
  const std::vector<std::string> names = param_names(camera.lens);
  return lens[std::ranges::find(names, named->second) - names.begin()];
}

/// Position of a depth sensor that determines the scale.
void add_depth_arm(const Localization& report, std::vector<Assumption>& assumed) {
  constexpr double ordinary_m = 0.01;
  double weights = 0.0;
  for (const SensorScale& each : report.sensor_scales)
    if (each.sigma_rel > 0.0) weights += 1.0 / (each.sigma_rel * each.sigma_rel);
  for (const SensorScale& each : report.sensor_scales) {
    if (!report.is_scale_read || !(each.sigma_rel > 0.0) || !(each.arm_effect > 0.0)) continue;
    const double moved_by = each.arm_effect / (each.sigma_rel * each.sigma_rel * weights);
    Assumption arm{.name = "depth_arm_m", .value = each.arm_given_m, .ordinary = ordinary_m};
    arm.moves = moved_by * std::sqrt(weights);
    arm.moved = "the scale";
    arm.moved_by = moved_by;
    arm.remedy = "measure where the depth sensor is in the camera's frame: --depth-arm, with --sigma-depth-arm";
    assumed.push_back(arm);
  }
}

/// Mirrored images look like those of a mirrored world. Handedness is determined only by known points, or by rotations
/// measured with another sensor.
bool has_handedness(const Localization& report) {
  const bool is_turned =
      std::ranges::any_of(report.sensor_scales, [](const SensorScale& each) { return each.sensor == "odometry"; });
  const bool has_known = std::ranges::any_of(report.path, [](const PathStep& step) { return step.num_known > 0; });
  return report.imu || report.is_in_map || is_turned || has_known;
}

}  // namespace

std::vector<Assumption> localize_assumed(const Localization& report) {
  std::vector<Assumption> assumed;
  if (!std::ranges::any_of(report.path, &PathStep::has_pose)) return assumed;
  for (const GivenNumber& given : report.given) {
    const auto named = std::ranges::find(all_named, given.name, &Named::given);
    if (named == all_named.end()) continue;
    const bool is_scale = named->given == "scale of the target", is_clock = named->given == "clock";
    const bool is_port = named->given.starts_with("port's") || named->given.starts_with("water's");
    if ((is_scale || is_clock) && !report.scale_known) continue;
    Assumption each;
    each.name = named->name;
    each.value = value_of(named->given, report.camera);
    each.sigma = is_scale && !report.is_scale_given ? std::nullopt : given.sigma;
    each.ordinary = named->ordinary;
    const double error = each.sigma.value_or(named->ordinary);
    each.moves = given.moves * error;
    if (each.sigma && given.sigma_hidden > 0.0) {
      each.sigma = std::hypot(error, given.sigma_hidden);
      each.moves = given.moves * *each.sigma / std::hypot(1.0, given.moves * given.sigma_hidden);
    }
    each.moved = std::string(given.moved);
    each.moved_by = given.moved_by * error;
    each.remedy = is_scale   ? "give --sigma-scale, or σ in --target: sigma_m of each point, sigma_square_m of a board"
                  : is_clock ? "take times at the centre of each exposure, and give their error: --sigma-times (0 "
                               "where it does not matter)"
                  : is_port  ? remedy_port
                             : remedy_camera;
    assumed.push_back(each);
  }
  add_depth_arm(report, assumed);
  if (!has_handedness(report))
    assumed.push_back({.name = "images are not mirrored", .value = std::nan(""), .sigma = 0.0});
  return assumed;
}

void add_rate_assumed(double own_rate_hz, Localization& result) {
  if (!(own_rate_hz > 0.0) || result.path.size() < 2) return;
  const double taken_hz =
      static_cast<double>(result.path.size() - 1) / (result.path.back().t_s - result.path.front().t_s);
  if (std::abs(own_rate_hz / taken_hz - 1.0) <= 0.01) return;
  result.assumed.push_back({.name = fmt::format("frames a second, not the video's own {:.4g}", own_rate_hz),
                            .value = taken_hz,
                            .sigma = 0.0,
                            .remedy = "leave --rate out"});
}

}  // namespace alidade
