#include "alidade/loop/rest_trials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "alidade/servo/head_servo.h"

namespace alidade {
namespace {

constexpr double min_settle_s = 8.0, max_settle_s = 60.0;
constexpr double min_periods = 100.0, max_periods = 8000.0;
constexpr double of_image = 0.25;          // of its height: how far the target jumps in either direction
constexpr double much = 3.0, lasts = 0.7;  // swing over that without limits, and over what it was before
constexpr double least_px = 0.3;           // without noise there is nothing to compare with

/// The scene with its target at rest at its start, always seen, and the lens as it is.
ServoScene at_rest(const ServoScene& from) {
  ServoScene scene = from;
  scene.path = {};
  scene.path.kind = PathKind::still;
  scene.path.start_m = from.path.recorded_m.empty() ? from.path.start_m : from.path.recorded_m.front();
  scene.hidden_s.clear();
  return scene;
}

/// To where a head sees it a quarter of its image aside, in the narrowest of the images.
Eigen::Vector3d jump_of(const ServoScene& scene) {
  Eigen::Vector3d smallest = Eigen::Vector3d::Zero();
  for (const RigHead& head : scene.heads) {
    const auto readings = aim(head.head, scene.path.start_m);
    if (!readings) continue;
    const double aside_px = of_image * std::min(head.camera.width_px, head.camera.height_px);
    const auto centre = ray_in_world(head, *readings, centre_of(head.camera));
    const auto ray = ray_in_world(head, *readings, centre_of(head.camera) + Eigen::Vector2d::Constant(aside_px));
    if (!centre || !ray) continue;
    const double range_m = (scene.path.start_m - centre->origin_in_world).norm();
    const Eigen::Vector3d jump = range_m * (ray->direction_in_world - centre->direction_in_world);
    if (smallest.isZero() || jump.norm() < smallest.norm()) smallest = jump;
  }
  return smallest;
}

double rate_limit(const ServoPlant& plant) {
  return std::visit([](const auto& p) { return p.max_rate_rad_s; }, plant);
}
double acceleration_limit(const ServoPlant& plant) {
  return std::visit([](const auto& p) { return p.max_acceleration_rad_s2; }, plant);
}

/// What of an axis is not linear.
enum Nonlinear { limits, dead_band, backlash, num_nonlinear };
constexpr std::array<const char*, num_nonlinear> nonlinear_words{"the limits of rate and acceleration", "the dead band",
                                                                 "backlash"};

bool has(const ServoAxis& axis, Nonlinear what) {
  if (what == dead_band) return axis.dead_band > 0.0;
  if (what == backlash) return axis.backlash_rad > 0.0;
  return std::isfinite(rate_limit(axis.plant)) || std::isfinite(acceleration_limit(axis.plant));
}

/// The closed form of a rate plant divides by the limit of its acceleration: one that nothing reaches.
void remove_limits(ServoPlant& of) {
  constexpr double beyond_all = 1e9;
  const bool is_rate_plant = std::holds_alternative<RatePlant>(of);
  std::visit(
      [&](auto& plant) {
        plant.max_rate_rad_s = plant.max_acceleration_rad_s2 =
            is_rate_plant ? beyond_all : std::numeric_limits<double>::infinity();
      },
      of);
}

ServoScene without(const ServoScene& from, std::span<const Nonlinear> removed) {
  ServoScene scene = from;
  for (ServoAxis& axis : scene.axes) {
    for (const Nonlinear what : removed) {
      if (what == limits) remove_limits(axis.plant);
      if (what == dead_band) axis.dead_band = 0.0;
      if (what == backlash) axis.backlash_rad = 0.0;
    }
  }
  return scene;
}

std::vector<Nonlinear> nonlinear_of(const ServoScene& scene) {
  std::vector<Nonlinear> all;
  for (const Nonlinear what : {limits, dead_band, backlash})
    if (std::ranges::any_of(scene.axes, [what](const ServoAxis& axis) { return has(axis, what); })) all.push_back(what);
  return all;
}

/// Ten times as long as an axis at its limits takes from zero to its target, or as the loop usually has.
double settling_s(const ServoScene& scene) {
  double longest_s = std::max(min_settle_s, min_periods * scene.period_s);
  for (const RigHead& head : scene.heads) {
    const double way_rad = aim(head.head, scene.path.start_m).value_or(Eigen::Vector2d::Zero()).cwiseAbs().maxCoeff() +
                           of_image * head.camera.height_px / focal_of(head.camera);
    for (const ServoAxis& axis : scene.axes)
      longest_s = std::max(longest_s, 10.0 * (way_rad / rate_limit(axis.plant) +
                                              2.0 * std::sqrt(way_rad / acceleration_limit(axis.plant))));
  }
  return std::min({longest_s, std::max(max_settle_s, min_periods * scene.period_s), max_periods * scene.period_s});
}

/// RMS of each head about its mean from a time to another: a dead band may leave it aside, which is no swing.
std::vector<double> swings_of(const ServoScene& scene, const ServoRun& run, double from_s, double until_s) {
  struct Sums {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double sum2 = 0.0, seen = 0.0, behind2 = 0.0, num = 0.0;
  };
  std::vector<Sums> all(scene.heads.size());
  for (const ServoRow& row : run.rows) {
    if (row.t_s < from_s || row.t_s >= until_s) continue;
    Sums& own = all[row.head];
    const double behind_px = 3.14 * row.true_lens[0];
    own.num += 1.0;
    if (row.error_px.allFinite() && row.error_px.norm() < behind_px) {
      own.sum += row.error_px;
      own.sum2 += row.error_px.squaredNorm();
      own.seen += 1.0;
    } else {
      own.behind2 += behind_px * behind_px;
    }
  }
  std::vector<double> rms;
  for (const Sums& own : all) {
    const double about = own.seen > 0.0 ? std::max(0.0, own.sum2 - own.sum.squaredNorm() / own.seen) : 0.0;
    rms.push_back(std::sqrt((about + own.behind2) / std::max(1.0, own.num)));
  }
  return rms;
}

/// Those without which alone the loop rests; where there are none, all.
std::string cause_of(const ServoScene& scene, const ServoConfig& config, const Swing& swing, double from_s) {
  std::string text, all;
  for (const Nonlinear what : nonlinear_of(scene)) {
    const std::array<Nonlinear, 1> one{what};
    const std::vector<double> left =
        swings_of(scene, run_servo(without(scene, one), config, 1), from_s, scene.duration_s);
    const Swing without_it{std::ranges::max(left), 0.0, swing.free_px};
    const char* words = nonlinear_words[static_cast<std::size_t>(what)];
    if (without_it.over_free() < much) text += (text.empty() ? "" : " or ") + std::string(words);
    all += (all.empty() ? "" : ", ") + std::string(words);
  }
  return text.empty() ? all : text;
}

}  // namespace

double zoomed_rest_px(const ServoScenario& scenario, ControllerKind kind) {
  constexpr double zoom_from_s = 2.0, zoom_until_s = 3.0;
  ServoScene scene = at_rest(scenario.scene);
  scene.zoom.t_s = {zoom_from_s, zoom_until_s};
  scene.zoom.factor = {1.0, scenario.scene.zoom.largest()};
  const double settle_s = std::max(min_settle_s, min_periods * scene.period_s);
  scene.warm_up_s = zoom_until_s + settle_s;
  scene.duration_s = scene.warm_up_s + 0.5 * settle_s;
  ServoConfig config = scenario.config;
  config.controller = kind;
  return run_servo(scene, config, 1).figures.rms_px;
}

double Swing::over_free() const { return rms_px / std::max(free_px, least_px); }

bool Swing::is_for_good() const { return over_free() > much && rms_px > lasts * before_px; }

bool is_linear(const ServoScene& scene) { return nonlinear_of(scene).empty(); }

Swing swing_after_a_jump(const ServoScenario& scenario, ControllerKind kind) {
  ServoScene scene = at_rest(scenario.scene);
  scene.zoom = {};
  const double settle_s = settling_s(scene);
  scene.path.kind = PathKind::step;
  scene.path.jump_m = jump_of(scene);
  scene.path.jump_at_s = settle_s;
  scene.duration_s = 4.0 * settle_s;
  ServoConfig config = scenario.config;
  config.controller = kind;
  const ServoRun run = run_servo(scene, config, 1), free = run_servo(without(scene, nonlinear_of(scene)), config, 1);
  const std::vector<double> last = swings_of(scene, run, 3.0 * settle_s, scene.duration_s),
                            before = swings_of(scene, run, 2.0 * settle_s, 3.0 * settle_s),
                            unlimited = swings_of(scene, free, 3.0 * settle_s, scene.duration_s);
  Swing worst;
  for (std::size_t head = 0; head < last.size(); ++head) {
    const Swing swing{last[head], before[head], unlimited[head]};
    if (swing.over_free() > worst.over_free()) worst = swing;
  }
  if (worst.is_for_good()) worst.cause = cause_of(scene, config, worst, 3.0 * settle_s);
  return worst;
}

}  // namespace alidade
