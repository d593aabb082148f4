#include "alidade/loop/servo_study.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/loop/rest_trials.h"
#include "alidade/servo/axis/axis_settling.h"
#include "alidade/servo/head_servo.h"

namespace alidade {
namespace {

constexpr double max_rest_px = 20.0;  // noise leaves a few; a loop that swings has hundreds

double units_of_error_per_rad(ErrorUnit unit, double focal_px) { return PiGains{1.0, 0.0, unit}.per_rad(focal_px).kp; }

int samples_in(double delay_s, double period_s) { return static_cast<int>(std::ceil(delay_s / period_s - 1e-9)); }

/// An image waits for the next period, a command does not. `pi` alone looks at images.
int images_late(const ServoScene& scene, ControllerKind kind) {
  return kind == ControllerKind::pi ? samples_in(scene.latency_s, scene.period_s) : 0;
}

/// The plant as it is read with its gain in the other unit.
ServoPlant in_other_unit(const ServoPlant& plant) {
  ServoPlant other = plant;
  std::visit([](auto& p) { p.unit = p.unit == AngleUnit::deg ? AngleUnit::rad : AngleUnit::deg; }, other);
  return other;
}

AngleUnit unit_of(const ServoPlant& plant) {
  return std::visit([](const auto& p) { return p.unit; }, plant);
}

/// But for their stops, which no loop knows.
bool axes_are_alike(const ServoScene& scene) {
  ServoAxis tilt = scene.axes[1];
  tilt.min_rad = scene.axes[0].min_rad;
  tilt.max_rad = scene.axes[0].max_rad;
  return tilt == scene.axes[0];
}

/// " of head 2", where there are heads with different lenses, and " in tilt" where the axes differ: of a loop that is
/// not alike for all of them.
std::string of_which(const ServoScenario& scenario, const LoopCheck& loop) {
  if (loop.delay_samples < 0) return "";
  const std::vector<RigHead>& heads = scenario.scene.heads;
  const bool are_alike = std::ranges::all_of(
      heads, [&](const RigHead& head) { return focal_of(head.camera) == focal_of(heads[0].camera); });
  std::string text = are_alike ? "" : " of head " + std::to_string(loop.head + 1);
  if (!axes_are_alike(scenario.scene)) text += loop.axis == 0 ? " in pan" : " in tilt";
  return text;
}

/// A loop that predicts where the target is from pixels that it takes by too short a lens.
Verdict restless(const ServoScenario& scenario, const LoopCheck& loop) {
  Verdict verdict;
  verdict.state = State::refused;
  verdict.exit_code = ExitCode::undetermined;
  verdict.sentence = "the loop of " + std::string(controller_name(loop.controller)) + " is unstable once the lens is " +
                     text_of(scenario.scene.zoom.largest()) +
                     " times as long as it takes it for: about a target at rest it swings by " +
                     text_of(loop.rest_px, 2) + " px RMS";
  verdict.to_add = "--intrinsics observed, or less zoom";
  verdict.checks.push_back({"loop at rest", State::refused, verdict.sentence, loop.rest_px, max_rest_px, "px", ""});
  return verdict;
}

Verdict unstable(const ServoScenario& scenario, const LoopCheck& loop) {
  if (loop.analysis.is_stable()) return restless(scenario, loop);
  const ServoScene& scene = scenario.scene;
  const AngleUnit unit = unit_of(scene.axes[loop.axis].plant);
  const double focal_px = focal_of(scene.heads[loop.head].camera);
  ServoAxis other = as_it_is(scene.axes[loop.axis], scene.mismatch);
  other.plant = in_other_unit(other.plant);
  const LoopAnalysis as_other =
      analysed(other, scenario.config.pi.per_rad(focal_px), scene.period_s, images_late(scene, loop.controller));
  Verdict verdict;
  verdict.state = State::refused;
  verdict.exit_code = ExitCode::undetermined;
  verdict.sentence = "the loop of " + std::string(controller_name(loop.controller)) + " sampled each " +
                     text_of(scenario.scene.period_s) + " s is unstable: spectral radius " +
                     text_of(loop.analysis.sampled_radius, 4) + of_which(scenario, loop);
  if (loop.delay_samples >= 0)
    verdict.sentence +=
        ", loop gain " + text_of(loop.loop_gain, 4) + " error units per " + std::string(unit_name(unit));
  verdict.to_add = loop.delay_samples < 0 ? "lower rate_gain_per_s, raise command_weight, or identify the plant again"
                   : as_other.is_stable() ? "is the gain in " + std::string(unit_name(unit_of(other.plant))) +
                                                "? then the radius is " + text_of(as_other.sampled_radius, 4)
                                          : "lower kp and ki, shorten the latency, or sample faster";
  verdict.checks.push_back(
      {"sampled loop", State::refused, verdict.sentence, loop.analysis.sampled_radius, 1.0, "1", ""});
  return verdict;
}

std::string margin_text(const LoopAnalysis& analysis) {
  return analysis.crossover_rad_s > 0.0 ? ", phase margin " + text_of(analysis.phase_margin_deg) + " deg" : "";
}

/// A limit cycle.
std::string swing_text(const LoopCheck& loop) {
  return std::string(controller_name(loop.controller)) + " swings for good by " + text_of(loop.swing_px) +
         " px RMS after a jump of the target, by " + loop.swings_by + " (" + text_of(loop.free_px) + " px without)";
}

const ServoComparison& best_of(const ServoStudy& study) {
  return *std::ranges::find(study.comparison, study.best, &ServoComparison::controller);
}

void add_check(Verdict& verdict, std::string name, bool is_good, std::string text, double value, double limit,
               std::string unit) {
  verdict.checks.push_back(
      {std::move(name), is_good ? State::good : State::care, std::move(text), value, limit, std::move(unit), ""});
}

void add_loop_checks(const ServoScenario& scenario, const ServoStudy& study, Verdict& verdict) {
  for (const LoopCheck& loop : study.loops) {
    const std::string name = "loop of " + std::string(controller_name(loop.controller));
    const double most = loop.delay_samples < 0 ? 0.995 : 0.98;  // one that was tried has a slow observer in it, too
    if (loop.swings())
      add_check(verdict, name, loop.swing_px <= scenario.specification_px && !loop.swings_by.starts_with("the limits"),
                swing_text(loop), loop.swing_px, loop.free_px, "px");
    else
      add_check(verdict, name, loop.analysis.sampled_radius < most,
                "spectral radius " + text_of(loop.analysis.sampled_radius, 4) + of_which(scenario, loop) +
                    margin_text(loop.analysis),
                loop.analysis.sampled_radius, most, "1");
    if (loop.radius_within_sigma > 0.0)
      add_check(verdict, name + " within 3 sigma", loop.radius_within_sigma < 1.0,
                loop.radius_within_sigma < 1.0
                    ? "stable where the plant is off by three of its sigma"
                    : "unstable where the plant is off by three of its sigma (spectral radius " +
                          text_of(loop.radius_within_sigma, 4) + "): log it for longer, or lower the gains",
                loop.radius_within_sigma, 1.0, "1");
  }
}

/// Heads that lose the target for good; empty: none.
std::string gone_text(const ServoFigures& figures) {
  constexpr double for_good = 0.25;
  std::string text;
  for (std::size_t i = 0; i < figures.gone.size(); ++i)
    if (figures.gone[i] > for_good)
      text += (text.empty() ? "head " : ", head ") + std::to_string(i + 1) + " loses the target for good (the last " +
              text_of(100.0 * figures.gone[i], 2) + " % of the time without it)";
  return text;
}

void add_checks(const ServoScenario& scenario, const ServoStudy& study, Verdict& verdict) {
  const ServoFigures& best = best_of(study).figures;
  const auto add = [&](const char* name, bool is_good, std::string text, double value, double limit, const char* unit) {
    add_check(verdict, name, is_good, std::move(text), value, limit, unit);
  };
  const double asked = scenario.specification_px;
  add("specification", best.rms_px <= asked, text_of(best.rms_px) + " px RMS of " + text_of(asked) + " px asked for",
      best.rms_px, asked, "px");
  if (best.rms_px <= asked && best.between_px > asked)  // otherwise the specification says it
    add("between the images", false, text_of(best.between_px) + " px RMS between the images: sample faster",
        best.between_px, asked, "px");
  add("in the image", best.in_image >= 1.0, text_of(100.0 * best.in_image) + " % of the time in the image",
      best.in_image, 1.0, "1");
  if (best.unseen > 0.0)
    add("seen", false, text_of(100.0 * best.unseen) + " % of the time a head has not seen the target yet", best.unseen,
        0.0, "1");
  if (best.num_lost > 0)
    add("lost", false,
        "lost " + std::to_string(best.num_lost) + " times, found again " + std::to_string(best.num_found) + " times",
        static_cast<double>(best.num_lost), 0.0, "times");
  if (scenario.scene.intrinsics == LensKnowledge::observed) {
    constexpr double max_z = 2.0;
    add("observed focal length", best.focal_z <= max_z,
        text_of(100.0 * best.focal_share) + " % off (RMS), " + text_of(best.focal_z) + " of its sigma", best.focal_z,
        max_z, "sigma");
  }
  add_loop_checks(scenario, study, verdict);
}

/// A controller, tried on both axes as they are.
double settling_of(const ServoScenario& scenario, ControllerKind kind, double focal_px) {
  const ServoScene& scene = scenario.scene;
  ServoConfig config = scenario.config;
  config.controller = kind;
  config.period_s = scene.period_s;
  double slowest = 0.0;
  for (const ServoAxis& known : scene.axes) {
    const ServoAxis real = as_it_is(known, scene.mismatch);
    slowest = std::max(slowest, settling_per_period(config, known, real, focal_px, scene.latency_s));
  }
  return slowest;
}

bool is_linear_loop(const ServoScenario& scenario, ControllerKind kind) {
  const bool are_angles = std::ranges::all_of(
      scenario.scene.axes, [](const ServoAxis& axis) { return std::holds_alternative<AnglePlant>(axis.plant); });
  return kind == ControllerKind::pi || (kind == ControllerKind::feedforward && are_angles);
}

/// Of one focal length and one axis; the lens becomes `largest` times as long, unknown to the loop.
LoopCheck linear_loop_of(const ServoScenario& scenario, ControllerKind kind, std::size_t of_axis, double focal_px,
                         double largest) {
  const ServoScene& scene = scenario.scene;
  const bool is_pi = kind == ControllerKind::pi;
  const ServoAxis axis = as_it_is(scene.axes[of_axis], scene.mismatch);
  LoopCheck loop{kind, {}, 0.0, -1};
  const int late = images_late(scene, kind);
  loop.delay_samples = late + samples_in(axis.command_delay_s, scene.period_s);
  const double factor = is_pi ? largest : 1.0;  // what corrects feedforward looks at the encoder
  loop.loop_gain = units_of_error_per_rad(scenario.config.pi.unit, focal_px) * radians_in(unit_of(axis.plant)) * factor;
  const PiGains gains = scenario.config.pi.per_rad(focal_px);
  loop.analysis = analysed(axis, {factor * gains.kp, factor * gains.ki, gains.unit}, scene.period_s, late);
  loop.axis = of_axis;
  return loop;
}

/// Of all heads and both axes the loop nearest to instability.
LoopCheck worst_loop_of(const ServoScenario& scenario, ControllerKind kind, double largest) {
  const std::vector<RigHead>& heads = scenario.scene.heads;
  LoopCheck worst{kind, {}, 0.0, -1};
  if (!is_linear_loop(scenario, kind)) {
    worst.analysis.sampled_radius = settling_of(scenario, kind, focal_of(heads[0].camera));
    return worst;
  }
  std::vector<double> seen_px;
  for (std::size_t head = 0; head < heads.size(); ++head) {
    const double focal_px = focal_of(heads[head].camera);
    if (std::ranges::count(seen_px, focal_px) > 0) continue;
    seen_px.push_back(focal_px);
    for (std::size_t axis = 0; axis < (axes_are_alike(scenario.scene) ? 1u : 2u); ++axis) {
      LoopCheck loop = linear_loop_of(scenario, kind, axis, focal_px, largest);
      loop.head = head;
      if (loop.analysis.sampled_radius > worst.analysis.sampled_radius) worst = loop;
    }
  }
  return worst;
}

/// Of plants that are off by 3σ, each number either way, the largest radius.
double radius_within_sigma(const ServoScenario& scenario, ControllerKind kind, double largest) {
  constexpr double in_sigma = 3.0, least = 0.01;
  const PlantSigma& sigma = scenario.scene.plant_sigma;
  if (sigma.is_exact()) return 0.0;
  const ServoPlant& plant = scenario.scene.axes[0].plant;
  const double gain = std::visit([](const auto& p) { return std::abs(p.gain); }, plant);
  double radius = 0.0;
  for (const double of_gain : {-in_sigma, in_sigma})
    for (const double of_tau : {-in_sigma, in_sigma})
      for (const double of_delay : {-in_sigma, in_sigma}) {
        ServoScenario off = scenario;
        off.scene.mismatch.gain *= std::max(least, 1.0 + of_gain * sigma.gain / gain);
        off.scene.mismatch.tau *= std::max(least, 1.0 + of_tau * sigma.tau_s / tau_of(plant));
        off.scene.mismatch.later_s += of_delay * sigma.command_delay_s;
        radius = std::max(radius, worst_loop_of(off, kind, largest).analysis.sampled_radius);
      }
  return radius;
}

}  // namespace

bool LoopCheck::is_stable() const { return analysis.is_stable() && rest_px < max_rest_px; }

std::vector<LoopCheck> check_loops(const ServoScenario& scenario) {
  std::vector<LoopCheck> loops;
  const ServoScene& scene = scenario.scene;
  // A lens that zooms while the loop keeps its old focal length is that much more gain.
  const double largest = scene.intrinsics == LensKnowledge::given ? scene.zoom.largest() : 1.0;
  for (const ControllerKind kind : scenario.controllers) {
    LoopCheck worst = worst_loop_of(scenario, kind, largest);
    if (kind != ControllerKind::pi && largest > 1.0) worst.rest_px = zoomed_rest_px(scenario, kind);
    if (worst.is_stable() && !is_linear(scene)) {
      const Swing swing = swing_after_a_jump(scenario, kind);
      if (swing.is_for_good()) worst.swing_px = swing.rms_px;
      worst.swings_by = swing.cause;
      worst.free_px = swing.free_px;
    }
    if (worst.is_stable()) worst.radius_within_sigma = radius_within_sigma(scenario, kind, largest);
    loops.push_back(worst);
  }
  return loops;
}

Verdict servo_verdict(const ServoScenario& scenario, const ServoStudy& study) {
  for (const LoopCheck& loop : study.loops)
    if (!loop.is_stable()) return unstable(scenario, loop);
  Verdict verdict;
  add_checks(scenario, study, verdict);
  const ServoFigures& best = best_of(study).figures;
  verdict.sentence = std::string(controller_name(study.best)) + " keeps the target within " + text_of(best.rms_px) +
                     " px RMS of the centre";
  const auto pi = std::ranges::find(study.comparison, ControllerKind::pi, &ServoComparison::controller);
  if (pi != study.comparison.end() && study.best != ControllerKind::pi)
    verdict.sentence += ", pi within " + text_of(pi->figures.rms_px) + " px";
  if (best.unseen > 0.5) {
    verdict.state = State::bad;
    verdict.sentence = (best.unseen < 1.0 ? text_of(100.0 * best.unseen) + " % of the time no head has seen the target"
                                          : std::string("no head ever sees the target")) +
                       ": the figures are those of heads that nothing moves";
    return verdict;
  }
  if (best.in_image < 0.5) {
    verdict.state = State::bad;
    verdict.sentence += "; in the image " + text_of(100.0 * best.in_image) + " % of the time only";
    return verdict;
  }
  if (const std::string gone = gone_text(best); !gone.empty()) {
    verdict.state = State::bad;
    verdict.sentence += "; " + gone;
    return verdict;
  }
  const auto own = std::ranges::find(study.loops, study.best, &LoopCheck::controller);
  if (own != study.loops.end() && own->swings() && best.rms_px > scenario.specification_px) {
    verdict.state = State::bad;
    verdict.sentence += "; " + swing_text(*own);
    return verdict;
  }
  for (const Check& check : verdict.checks) {
    if (check.state == State::good) continue;
    if (verdict.state == State::good) verdict.sentence += "; " + check.name + ": " + check.text;
    verdict.state = State::care;
  }
  return verdict;
}

}  // namespace alidade
