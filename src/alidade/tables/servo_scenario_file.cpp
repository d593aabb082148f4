#include "alidade/tables/servo_scenario_file.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

#include "alidade/files/yaml_fields.h"
#include "alidade/formats/rig_file.h"
#include "alidade/geometry/degree.h"
#include "alidade/tables/events_file.h"

namespace alidade {
namespace {

using detail::Fields;
using detail::refuse;
using detail::refuse_unknown_keys;

double within(const Fields& fields, const std::string& key, double low, double high) {
  const double value = fields.number(key);
  if (!(value >= low && value <= high))
    refuse(fields.file(), fields.full(key), fmt::format("{} is not between {:g} and {:g}", value, low, high));
  return value;
}

/// Within its limits, or what it was; in the file in another unit. `described`: fields of the scenario, `value` among
/// them.
void read_number(const Fields& fields, const std::string& key, double& value, const FieldList& described,
                 double unit = 1.0) {
  if (!fields.has(key)) return;
  const auto field = std::ranges::find_if(described, [&](const Field& each) {
    double* const* const pointer = std::get_if<double*>(&each.value);
    return pointer != nullptr && *pointer == &value;
  });
  const double slack = unit == 1.0 ? 1.0 : 1.0 + 1e-12;  // 90 / unit * unit is not quite 90
  value = unit * within(fields, key, field->limits.min / unit / slack, field->limits.max / unit * slack);
}

/// A section of the file, or an empty one.
class Section {
 public:
  Section(const YAML::Node& root, const Fields& parent, const std::string& key, const std::vector<std::string>& known)
      : node_(parent.has(key) ? root[key] : YAML::Node(YAML::NodeType::Map)),
        fields_(node_, parent.file(), parent.full(key + ".")) {
    refuse_unknown_keys(fields_, known, key);
  }
  [[nodiscard]] const Fields& fields() const { return fields_; }
  [[nodiscard]] bool has(const std::string& key) const { return fields_.has(key); }
  [[nodiscard]] bool is_empty() const { return fields_.keys().empty(); }

  void number(const std::string& key, double& value, const FieldList& described, double unit = 1.0) const {
    read_number(fields_, key, value, described, unit);
  }
  void vector(const std::string& key, Eigen::Vector3d& value) const {
    if (fields_.has(key)) value = detail::read_vector(fields_, key);
    if (!(value.cwiseAbs().maxCoeff() <= 1e4)) refuse(fields_.file(), fields_.full(key), "is further than 10 km");
  }
  /// One of some words, by what converts a word to a value.
  template <class Value, class Named>
  void word(const std::string& key, Value& value, const Named& named, const std::string& choices) const {
    if (!fields_.has(key)) return;
    const auto found = named(fields_.text(key));
    if (!found)
      refuse(fields_.file(), fields_.full(key), fmt::format("'{}' is not one of {}", fields_.text(key), choices));
    value = *found;
  }
  /// [low, high] of angles in degrees.
  void limits(const std::string& key, ServoAxis& axis) const {
    if (!fields_.has(key)) return;
    const std::vector<double> numbers = fields_.numbers(key);
    if (numbers.size() != 2 || !(numbers[0] < numbers[1]))
      refuse(fields_.file(), fields_.full(key), "must be two angles, the lower one first");
    axis.min_rad = degree * numbers[0];
    axis.max_rad = degree * numbers[1];
  }

 private:
  YAML::Node node_;
  Fields fields_;
};

std::optional<bool> yes_or_no(const std::string& word) {
  if (word == "true") return true;
  if (word == "false") return false;
  return std::nullopt;
}

std::optional<ErrorUnit> error_unit(const std::string& name) {
  if (name == "px") return ErrorUnit::px;
  if (name == "deg") return ErrorUnit::deg;
  if (name == "rad") return ErrorUnit::rad;
  return std::nullopt;
}

void read_target(const YAML::Node& root, const Fields& top, ServoScenarioFile& read,
                 const std::filesystem::path& folder) {
  const FieldList described = fields_of(read.scenario);
  TargetPath& path = read.scenario.scene.path;
  const Section target(root, top, "target",
                       {"path", "start_m", "radius_m", "period_s", "jump_m", "jump_at_s", "track"});
  if (target.has("track")) {
    if (target.has("path")) refuse(target.fields().file(), target.fields().full("track"), "excludes a path");
    read.track = folder / target.fields().text("track");
    path = read_recorded_path(read.track);
  }
  target.word("path", path.kind, path_named, "still, circle, sway, step, manoeuvre");
  target.vector("start_m", path.start_m);
  target.number("radius_m", path.radius_m, described);
  target.number("period_s", path.period_s, described);
  target.vector("jump_m", path.jump_m);
  target.number("jump_at_s", path.jump_at_s, described);
}

void read_gain(const Section& section, const FieldList& described, auto& plant) {
  section.number("gain", plant.gain, described);
  if (plant.gain == 0.0) refuse(section.fields().file(), section.fields().full("gain"), "is zero");
  if (section.has("gain") && !section.has("unit"))
    refuse(section.fields().file(), section.fields().full("unit"), "is missing: deg or rad, what the gain gives");
  section.word("unit", plant.unit, unit_named, "deg, rad");
  section.number("tau_s", plant.tau_s, described);
}

void read_plant(const YAML::Node& root, const Fields& top, ServoScenario& scenario) {
  const Section section(
      root, top, "plant",
      {"kind", "gain", "unit", "tau_s", "max_rate_deg_s", "max_acceleration_deg_s2", "command_delay_s", "dead_band",
       "backlash_deg", "second_tau_s", "pan_deg", "tilt_deg", "sigma_gain", "sigma_tau_s", "sigma_command_delay_s"});
  bool is_rate_plant = false;
  section.word(
      "kind", is_rate_plant,
      [](const std::string& name) {
        return name == "rate" ? std::optional(true) : name == "angle" ? std::optional(false) : std::nullopt;
      },
      "angle, rate");
  ServoAxis& axis = scenario.scene.axes[0];
  axis = {};
  if (is_rate_plant) axis.plant = RatePlant{};
  const FieldList described = fields_of(scenario);
  if (is_rate_plant) {
    RatePlant& plant = std::get<RatePlant>(axis.plant);
    read_gain(section, described, plant);
    section.number("max_rate_deg_s", plant.max_rate_rad_s, described, degree);
    section.number("max_acceleration_deg_s2", plant.max_acceleration_rad_s2, described, degree);
    // A loop of 4/s, whatever a unit of command is.
    const double loop_per_s = 4.0 / plant.gain;
    scenario.config.pi = {loop_per_s, loop_per_s, plant.unit == AngleUnit::deg ? ErrorUnit::deg : ErrorUnit::rad};
  } else {
    AnglePlant& plant = std::get<AnglePlant>(axis.plant);
    read_gain(section, described, plant);
    section.number("max_rate_deg_s", plant.max_rate_rad_s, described, degree);
    section.number("max_acceleration_deg_s2", plant.max_acceleration_rad_s2, described, degree);
  }
  section.number("command_delay_s", axis.command_delay_s, described);
  PlantSigma& sigma = scenario.scene.plant_sigma;
  section.number("sigma_gain", sigma.gain, described);
  section.number("sigma_tau_s", sigma.tau_s, described);
  section.number("sigma_command_delay_s", sigma.command_delay_s, described);
  section.number("dead_band", axis.dead_band, described);
  section.number("backlash_deg", axis.backlash_rad, described, degree);
  section.number("second_tau_s", axis.second_tau_s, described);
  scenario.scene.axes[1] = axis;
  section.limits("pan_deg", scenario.scene.axes[0]);
  section.limits("tilt_deg", scenario.scene.axes[1]);
}

void read_noise(const YAML::Node& root, const Fields& top, ServoScenario& scenario) {
  ServoScene& scene = scenario.scene;
  const FieldList described = fields_of(scenario);
  const Section noise(root, top, "noise", {"sigma_px", "sigma_encoder_deg", "encoder_step_deg"});
  if (const double sigma_rad = scene.heads[0].head.encoder.sigma_rad; sigma_rad > 0.0)
    scene.sigma_encoder_rad = sigma_rad;
  noise.number("sigma_px", scene.sigma_px, described);
  noise.number("sigma_encoder_deg", scene.sigma_encoder_rad, described, degree);
  noise.number("encoder_step_deg", scene.encoder_step_rad, described, degree);
  scenario.config.sigma_px = std::max(scene.sigma_px, 1e-3);
  // A rounded reading errs by a twelfth of a step's square.
  scenario.config.sigma_encoder_rad =
      std::max(std::hypot(scene.sigma_encoder_rad, scene.encoder_step_rad / std::sqrt(12.0)), 1e-6);
}

void read_controllers(const YAML::Node& root, const Fields& top, ServoScenario& scenario) {
  if (top.has("controllers")) {
    scenario.controllers.clear();
    for (const std::string& name : top.texts("controllers")) {
      const auto kind = controller_named(name);
      if (!kind || std::ranges::count(scenario.controllers, *kind) > 0)
        refuse(top.file(), "controllers",
               kind ? fmt::format("'{}' appears twice", name)
                    : fmt::format("'{}' is not one of pi, feedforward, lqr, mpc", name));
      scenario.controllers.push_back(*kind);
    }
    if (scenario.controllers.empty()) refuse(top.file(), "controllers", "names none");
  }
  ServoConfig& config = scenario.config;
  const FieldList described = fields_of(scenario);
  const Section pi(root, top, "pi", {"kp", "ki", "unit"});
  if ((pi.has("kp") || pi.has("ki")) && !pi.has("unit"))
    refuse(top.file(), "pi.unit", "is missing: px, deg or rad, what the error is counted in");
  pi.number("kp", config.pi.kp, described);
  pi.number("ki", config.pi.ki, described);
  pi.word("unit", config.pi.unit, error_unit, "px, deg, rad");
  const Section predicted(root, top, "predictive", {"rate_gain_per_s", "command_weight", "range_m"});
  predicted.number("rate_gain_per_s", config.rate_gain_per_s, described);
  predicted.number("command_weight", config.command_weight, described);
  predicted.number("range_m", config.range_m, described);
}

void read_filter(const YAML::Node& root, const Fields& top, const FieldList& described, BearingFilterConfig& config) {
  const Section filter(root, top, "filter", {"singer_tau_s", "sigma_deg_s2", "memory_s", "start_rate_deg_s", "gate"});
  filter.number("singer_tau_s", config.singer_tau_s, described);
  filter.number("memory_s", config.memory_s, described);
  filter.number("start_rate_deg_s", config.start_rate_rad_s, described, degree);
  filter.number("gate", config.gate, described);
  if (!filter.has("sigma_deg_s2")) return;
  const std::vector<double> sigmas = filter.fields().numbers("sigma_deg_s2");
  const std::string key = filter.fields().full("sigma_deg_s2");
  if (sigmas.size() != 1 && sigmas.size() != num_agilities)
    refuse(top.file(), key, fmt::format("must be one number, or {}", num_agilities));
  for (std::size_t i = 0; i < num_agilities; ++i) {
    const double sigma = sigmas[sigmas.size() == 1 ? 0 : i];
    if (!(sigma > 0.0 && sigma <= 1e7)) refuse(top.file(), key, fmt::format("{} is not above 0 and below 1e7", sigma));
    config.sigma_rad_s2[i] = degree * sigma;
  }
}

void read_search(const YAML::Node& root, const Fields& top, const FieldList& described, SearchConfig& config) {
  const Section search(root, top, "search",
                       {"enabled", "coast_s", "carry_s", "speed_deg_s", "turn_of_view", "max_radius_deg"});
  search.word("enabled", config.enabled, yes_or_no, "true, false");
  search.number("coast_s", config.coast_s, described);
  search.number("carry_s", config.carry_s, described);
  search.number("speed_deg_s", config.speed_rad_s, described, degree);
  search.number("turn_of_view", config.turn_of_view, described);
  search.number("max_radius_deg", config.max_radius_rad, described, degree);
}

/// How the lenses zoom, and by which intrinsics the loop goes: an observer's where they do, by default.
void read_lens(const YAML::Node& root, const Fields& top, ServoScene& scene) {
  const Section section(root, top, "zoom", {"t_s", "factor"});
  if (section.has("t_s") || section.has("factor")) {
    ZoomProfile& zoom = scene.zoom;
    zoom.t_s = section.fields().numbers("t_s");
    zoom.factor = section.fields().numbers("factor");
    const std::string times = section.fields().full("t_s"), factors = section.fields().full("factor");
    if (zoom.t_s.empty() || zoom.t_s.size() != zoom.factor.size())
      refuse(top.file(), factors, "must be as many numbers as t_s, one or more");
    for (std::size_t i = 0; i < zoom.t_s.size(); ++i) {
      if (i > 0 && !(zoom.t_s[i - 1] < zoom.t_s[i]))
        refuse(top.file(), times, fmt::format("{} is not before {}", zoom.t_s[i - 1], zoom.t_s[i]));
      if (!(zoom.factor[i] >= 0.01 && zoom.factor[i] <= 100.0))
        refuse(top.file(), factors, fmt::format("{} is not between 0.01 and 100", zoom.factor[i]));
    }
    scene.intrinsics = LensKnowledge::observed;
  }
  if (top.has("intrinsics")) {
    const auto knowledge = lens_knowledge_named(top.text("intrinsics"));
    if (!knowledge)
      refuse(top.file(), "intrinsics", fmt::format("'{}' is not one of given, observed, true", top.text("intrinsics")));
    scene.intrinsics = *knowledge;
  }
  if (top.has("background_points"))
    scene.background_points = static_cast<std::size_t>(within(top, "background_points", 4, 200));
}

void read_robustness(const YAML::Node& root, const Fields& top, std::optional<RobustnessConfig>& robustness) {
  const Section section(root, top, "robustness", {"gain", "tau", "points"});
  RobustnessConfig config;
  const auto range = [&](const std::string& key, double& low, double& high) {
    if (!section.has(key)) return;
    const std::vector<double> numbers = section.fields().numbers(key);
    if (numbers.size() != 2 || !(numbers[0] > 0.0 && numbers[0] < numbers[1] && numbers[1] <= 100.0))
      refuse(top.file(), section.fields().full(key), "must be two factors above zero, the lower one first");
    low = numbers[0];
    high = numbers[1];
  };
  range("gain", config.gain_low, config.gain_high);
  range("tau", config.tau_low, config.tau_high);
  double points = config.points;
  if (section.has("points")) points = within(section.fields(), "points", 0.0, 50.0);
  config.points = static_cast<int>(points);
  if (points != config.points) refuse(top.file(), "robustness.points", "is not a whole number");
  robustness = config.points > 0 ? std::optional(config) : std::nullopt;
}

void read_timing(const YAML::Node& root, const Fields& top, ServoScenario& scenario) {
  ServoScene& scene = scenario.scene;
  const FieldList described = fields_of(scenario);
  read_number(top, "duration_s", scene.duration_s, described);
  read_number(top, "warm_up_s", scene.warm_up_s, described);
  read_number(top, "sample_period_s", scene.period_s, described);
  read_number(top, "latency_s", scene.latency_s, described);
  read_number(top, "specification_px", scenario.specification_px, described);
  double seeds = scenario.num_seeds;
  if (top.has("seeds")) seeds = within(top, "seeds", 1.0, 1000.0);
  if (seeds != std::floor(seeds)) refuse(top.file(), "seeds", "is not a whole number");
  scenario.num_seeds = static_cast<int>(seeds);
  if (!(scene.duration_s > scene.warm_up_s))
    refuse(top.file(), "duration_s",
           fmt::format("{} is not longer than the warm-up of {} s", scene.duration_s, scene.warm_up_s));
  if (scene.latency_s > 200.0 * scene.period_s)
    refuse(top.file(), "latency_s", fmt::format("{} is more than 200 images late", scene.latency_s));
  if (const double delay_s = scene.axes[0].command_delay_s;
      delay_s > (max_command_delay_periods + 1e-6) * scene.period_s)
    refuse(top.file(), "plant.command_delay_s",
           fmt::format("{} is more than {} periods of {} s: lengthen sample_period_s", delay_s,
                       max_command_delay_periods, scene.period_s));
  const Section mismatch(root, top, "mismatch", {"gain", "tau"});
  mismatch.number("gain", scene.mismatch.gain, described);
  mismatch.number("tau", scene.mismatch.tau, described);
  if (!top.has("hidden_s")) return;
  const std::vector<double> times = top.numbers("hidden_s");
  if (times.size() % 2 != 0) refuse(top.file(), "hidden_s", "must be pairs of times: from, to, from, to");
  for (std::size_t i = 0; i + 1 < times.size(); i += 2) {
    if (!(times[i] < times[i + 1]))
      refuse(top.file(), "hidden_s", fmt::format("{} is not before {}", times[i], times[i + 1]));
    scene.hidden_s.emplace_back(times[i], times[i + 1]);
  }
}

}  // namespace

TargetPath read_recorded_path(const std::filesystem::path& file) {
  const TrueTrack track = read_true_track(file);
  if (track.t_s.size() < 2) throw InputError(file.string() + ": has one row; a path has two or more");
  TargetPath path;
  path.kind = PathKind::recorded;
  path.recorded_s = track.t_s;
  path.recorded_m = track.position;
  return path;
}

ServoScenarioFile read_servo_scenario(const std::filesystem::path& file) {
  const YAML::Node root = detail::load_yaml(read_file(file), file.string());
  const Fields top(root, file.string());
  refuse_unknown_keys(top,
                      {"rig",        "target",     "duration_s",       "warm_up_s", "sample_period_s",  "latency_s",
                       "hidden_s",   "plant",      "mismatch",         "noise",     "controllers",      "pi",
                       "predictive", "filter",     "search",           "seeds",     "specification_px", "robustness",
                       "zoom",       "intrinsics", "background_points"},
                      "a servo's scenario");
  ServoScenarioFile read;
  if (top.has("rig")) {
    read.rig = file.parent_path() / top.text("rig");
    const Rig rig = read_rig(read.rig);
    if (!rig.intrinsics_histories.empty())
      refuse(read.rig.string(), "intrinsics", "is for `alidade track`; a scenario says `zoom` and `intrinsics` itself");
    read.scenario.scene.heads = rig.heads;
    read.scenario.scene.rig_errors = rig_uncertainty(rig);
    read.rig_doubts = rig.doubts;
  }
  read_target(root, top, read, file.parent_path());
  read_plant(root, top, read.scenario);
  read_noise(root, top, read.scenario);
  read_controllers(root, top, read.scenario);
  read_filter(root, top, fields_of(read.scenario), read.scenario.config.filter);
  read_search(root, top, fields_of(read.scenario), read.scenario.config.search);
  read_timing(root, top, read.scenario);
  read_robustness(root, top, read.scenario.robustness);
  read_lens(root, top, read.scenario.scene);
  return read;
}

std::string servo_scenario_text() {
  return R"(# Scenario of alidade servo. Every key is optional; these are the defaults.
# rig: rig.yaml                  # heads and cameras; default: the rig of Xiahou, Chen & Wu, 2015
target: {path: circle, start_m: [0.173, -0.314, 0.636], radius_m: 0.1, period_s: 10}  # still, sway, step, manoeuvre
# target: {track: path.csv}      # recorded path: t_s,x_m,y_m,z_m
duration_s: 12
warm_up_s: 2                     # excluded from the statistics
sample_period_s: 0.05            # images, encoders, commands
latency_s: 0                     # from capture of an image to its pixel
# hidden_s: [5, 6]               # from, to: the target is hidden
plant: {kind: angle, gain: 0.0567, unit: deg, tau_s: 0.1, command_delay_s: 0}
# plant: {kind: angle, gain: 1, tau_s: 0.06, max_rate_deg_s: 40, max_acceleration_deg_s2: 120}  # as written by `head --identify`
# plant: {kind: rate, gain: 1, unit: rad, tau_s: 0.05, max_rate_deg_s: 180, max_acceleration_deg_s2: 1500,
#         pan_deg: [-170, 170], tilt_deg: [-30, 90], dead_band: 0, backlash_deg: 0, second_tau_s: 0,
#         sigma_gain: 0, sigma_tau_s: 0, sigma_command_delay_s: 0}  # as written by `identify`; stability is checked within 3σ
mismatch: {gain: 1, tau: 1}      # true plant / plant known to the controllers
noise: {sigma_px: 0.5, sigma_encoder_deg: 0.05, encoder_step_deg: 0}
controllers: [pi, feedforward, lqr, mpc]
pi: {kp: 2, ki: 10, unit: px}    # command per error; for a rate plant 4/gain and 4/gain, in its unit
predictive: {rate_gain_per_s: 8, command_weight: 2, range_m: 1}
filter: {singer_tau_s: 0.4, sigma_deg_s2: [5, 20, 80, 320, 1280], memory_s: 0.5, gate: 20}
search: {enabled: true, coast_s: 0.3, carry_s: 0.2, speed_deg_s: 57.3, turn_of_view: 0.7, max_radius_deg: 45.8}
# zoom: {t_s: [3, 7], factor: [1, 3]}  # factor of all focal lengths over time, log-linear in between
# intrinsics: observed           # used by the loop: given (the rig's), observed (by an online observer) or true; default:
                                 # given without a zoom, observed with one
# background_points: 24          # static, behind the target, for the observer
seeds: 8
specification_px: 10
robustness: {gain: [0.8, 1.2], tau: [0.7, 1.3], points: 5}   # points: 0 skips it
)";
}

}  // namespace alidade
