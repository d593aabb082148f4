#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "alidade/estimation/config_error.h"
#include "alidade/geometry/degree.h"
#include "alidade/loop/servo_study.h"

// Loops that are called stable stay on a target at rest; those that are refused do not: over a grid of plants, gains,
// delays and mismatches, against the closed loop itself, with its pixels, filters and noise.

namespace alidade {
namespace {

struct GridCase {
  bool is_rate_plant;
  double command_delay_s, latency_s, gain_factor, tau_factor;
  double loop;  ///< Factor on what the controller does: kp and ki, rate_gain_per_s, one over the weight of effort.
};

std::vector<GridCase> grid() {
  std::vector<GridCase> cases;
  for (const bool is_rate_plant : {false, true})
    for (const double command_delay_s : {0.0, 0.03, 0.1})
      for (const double latency_s : {0.0, 0.08})
        for (const double gain_factor : {0.5, 1.0, 2.5, 6.0})
          for (const double loop : {0.05, 1.0, 4.0, 16.0})
            cases.push_back(
                {is_rate_plant, command_delay_s, latency_s, gain_factor, gain_factor > 2.0 ? 0.5 : 1.5, loop});
  return cases;
}

ServoScenario scenario_of(const GridCase& of, ControllerKind kind) {
  ServoScenario scenario;
  scenario.controllers = {kind};
  ServoScene& scene = scenario.scene;
  if (of.is_rate_plant) {
    for (ServoAxis& axis : scene.axes) axis.plant = RatePlant{};
    scenario.config.pi = {4.0, 4.0, ErrorUnit::rad};
  }
  for (ServoAxis& axis : scene.axes) axis.command_delay_s = of.command_delay_s;
  scene.latency_s = of.latency_s;
  scene.mismatch = {of.gain_factor, of.tau_factor};
  scene.path.kind = PathKind::still;
  scene.path.start_m = {0.25, 0.0,
                        8.0};  // nearly straight ahead: in the image also where a gain is six times too large
  scene.duration_s = 20.0;
  scene.warm_up_s = 10.0;
  scenario.config.pi.kp *= of.loop;
  scenario.config.pi.ki *= of.loop;
  scenario.config.rate_gain_per_s *= of.loop;
  scenario.config.command_weight /= of.loop;
  scenario.config.search.enabled = false;
  return scenario;
}

/// A plant that was identified has σ: what may then be unstable is named, and is as unstable as such a plant makes it.
TEST(ServoStability, WithinThreeSigmaOfThePlant) {
  ServoScenario scenario;
  scenario.controllers = {ControllerKind::pi, ControllerKind::lqr};
  scenario.num_seeds = 1;
  scenario.robustness.reset();
  EXPECT_EQ(check_loops(scenario)[0].radius_within_sigma, 0.0) << "none is given";
  const auto state_of = [&](double of_gain) {
    scenario.scene.plant_sigma.gain = of_gain * std::get<AnglePlant>(scenario.scene.axes[0].plant).gain;
    const ServoStudy study = study_servo(scenario, 1);
    const Verdict verdict = servo_verdict(scenario, study);
    for (const LoopCheck& loop : study.loops) {
      ServoScenario off = scenario;
      off.scene.plant_sigma = {};
      off.controllers = {loop.controller};
      double worst = 0.0;
      for (const double factor : {1.0 - 3.0 * of_gain, 1.0 + 3.0 * of_gain}) {
        off.scene.mismatch.gain = std::max(0.01, factor);
        worst = std::max(worst, check_loops(off)[0].analysis.sampled_radius);
      }
      EXPECT_NEAR(loop.radius_within_sigma, worst, 1e-9) << controller_name(loop.controller);
    }
    const auto named = std::ranges::find(verdict.checks, "loop of pi within 3 sigma", &Check::name);
    return named == verdict.checks.end() ? State::refused : named->state;
  };
  EXPECT_EQ(state_of(0.003), State::good);
  EXPECT_EQ(state_of(3.0), State::care);
}

TEST(ServoStability, WhatIsCalledStableStaysAndWhatIsRefusedDoesNot) {
  int num_stable = 0, num_unstable = 0;
  for (const ControllerKind kind : controller_kinds) {
    for (const GridCase& of : grid()) {
      const ServoScenario scenario = scenario_of(of, kind);
      const double radius = check_loops(scenario).front().analysis.sampled_radius;
      if (std::abs(radius - 1.0) < 0.01) continue;  // 10 s are too short to decide
      ServoConfig config = scenario.config;
      config.controller = kind;
      const double rms_px = run_servo(scenario.scene, config, 7).figures.rms_px;
      const std::string what = std::string(controller_name(kind)) + (of.is_rate_plant ? " rate" : " angle") +
                               " delay " + std::to_string(of.command_delay_s) + " latency " +
                               std::to_string(of.latency_s) + " gain " + std::to_string(of.gain_factor) + " loop " +
                               std::to_string(of.loop) + " radius " + std::to_string(radius);
      (radius < 1.0 ? num_stable : num_unstable) += 1;
      // Noise of 0.6 px, amplified where a loop is hardly stable. One that is not loses the target, or swings as far as
      // its limits of rate and acceleration let it (8 px at the least in this grid).
      if (radius < 1.0)
        EXPECT_LT(rms_px, 0.8 / (1.0 - radius) + 6.0) << what;
      else
        EXPECT_GT(rms_px, 5.0) << what;
    }
  }
  EXPECT_GT(num_stable, 150);
  EXPECT_GT(num_unstable, 50);
  RecordProperty("stable", num_stable);
  RecordProperty("unstable", num_unstable);
}

/// Slow is not unstable: a loop of 0.02/s, of which a hundred seconds see little.
TEST(ServoStability, SlowLoopsAreNotRefused) {
  GridCase slow{true, 0.03, 0.0, 1.0, 1.0, 0.02 / 8.0};
  const double radius = check_loops(scenario_of(slow, ControllerKind::feedforward)).front().analysis.sampled_radius;
  EXPECT_NEAR(radius, std::exp(-0.02 * 0.05), 2e-5);
}

/// kp is per pixel, and a long lens has more of them: 2 + 10/s round 0.0567/(0.1 s + 1) deg with f = 6000 px has
/// ρ = 3.82, worked out independently. Whichever head comes first.
TEST(ServoStability, EveryHeadsLensIsChecked) {
  for (const bool is_first : {false, true}) {
    ServoScenario scenario;
    scenario.controllers = {ControllerKind::pi, ControllerKind::feedforward};
    Camera& camera = scenario.scene.heads[is_first ? 0 : 1].camera;
    Eigen::VectorXd values = params(camera.lens);
    values.head<2>().setConstant(6000.0);
    camera.lens = with_params(camera.lens, values);
    const std::vector<LoopCheck> loops = check_loops(scenario);
    for (const LoopCheck& loop : loops) {
      EXPECT_NEAR(loop.analysis.sampled_radius, 3.824, 5e-3);
      EXPECT_EQ(loop.head, is_first ? 0u : 1u);
    }
    const ServoStudy study = study_servo(scenario, 1);
    EXPECT_EQ(study.status, ServoStudy::Status::unstable);
    const std::string sentence = servo_verdict(scenario, study).sentence;
    EXPECT_NE(sentence.find(is_first ? "of head 1" : "of head 2"), std::string::npos) << sentence;
  }
}

/// Errors that arrive after an axis has come to rest by itself: 160 images late, an integral of 3/s has long run
/// away.
TEST(ServoStability, ALoopMayBeLaterThanItsAxisIsSlow) {
  ServoScenario scenario;
  scenario.controllers = {ControllerKind::pi};
  scenario.scene.latency_s = 8.0;
  for (ServoAxis& axis : scenario.scene.axes) axis.command_delay_s = 0.03;
  EXPECT_GT(check_loops(scenario).front().analysis.sampled_radius, 1.0);
}

/// A tilt that is ten times as strong as the pan: the worse of both axes counts, and is named.
TEST(ServoStability, BothAxesAreChecked) {
  for (const ControllerKind kind : {ControllerKind::pi, ControllerKind::feedforward}) {
    ServoScenario scenario;
    scenario.controllers = {kind};
    std::get<AnglePlant>(scenario.scene.axes[1].plant).gain *= 10.0;
    const std::vector<LoopCheck> loops = check_loops(scenario);
    EXPECT_GT(loops.front().analysis.sampled_radius, 1.0);
    EXPECT_EQ(loops.front().axis, 1u);
    const std::string sentence = servo_verdict(scenario, study_servo(scenario, 1)).sentence;
    EXPECT_NE(sentence.find(" in tilt"), std::string::npos) << sentence;
  }
}

/// A plant as `identify` writes it, of which the acceleration makes pi a limit cycle: an independent simulation of the
/// drive swings by 589 px about a target at rest with 120°/s², and rests with 240°/s².
TEST(ServoStability, ALoopThatItsLimitsKeepSwingingIsNamed) {
  for (const bool swings : {true, false}) {
    ServoScenario scenario;
    scenario.controllers = {ControllerKind::pi};
    scenario.scene.path.radius_m = 0.05;
    scenario.scene.duration_s = 20.0;
    scenario.num_seeds = 2;
    scenario.robustness.reset();
    for (ServoAxis& axis : scenario.scene.axes)
      axis.plant = AnglePlant{.gain = 0.0567,
                              .unit = AngleUnit::deg,
                              .tau_s = 0.1,
                              .max_rate_rad_s = 60.0 * degree,
                              .max_acceleration_rad_s2 = (swings ? 120.0 : 240.0) * degree};
    const ServoStudy alone = study_servo(scenario, 1);
    EXPECT_LT(alone.loops.front().analysis.sampled_radius, 0.9);
    EXPECT_EQ(alone.loops.front().swings(), swings) << alone.loops.front().swing_px;
    const Verdict verdict = servo_verdict(scenario, alone);
    EXPECT_EQ(verdict.state, swings ? State::bad : State::good) << verdict.sentence;
    EXPECT_EQ(verdict.sentence.find("swings for good") != std::string::npos, swings) << verdict.sentence;
    scenario.controllers = {ControllerKind::pi, ControllerKind::feedforward};
    const Verdict beside = servo_verdict(scenario, study_servo(scenario, 1));
    EXPECT_EQ(beside.state, swings ? State::care : State::good) << beside.sentence;
  }
}

/// An integral in the loop of an axis that is commanded by its rate, and play: it swings for good. An independent
/// simulation of one axis swings by 3.6 px (σ), by 0.2 px without play; a dead band lets it rest.
TEST(ServoStability, ALoopThatBacklashKeepsSwingingIsNamed) {
  for (const bool has_play : {true, false}) {
    ServoScenario scenario;
    scenario.controllers = {ControllerKind::pi};
    scenario.config.pi = {4.0, 4.0, ErrorUnit::rad};
    for (ServoAxis& axis : scenario.scene.axes) {
      axis.plant = RatePlant{};
      axis.backlash_rad = has_play ? 5.0 * degree : 0.0;
      axis.dead_band = has_play ? 0.0 : 0.05;
    }
    const LoopCheck loop = check_loops(scenario).front();
    EXPECT_EQ(loop.swings(), has_play) << loop.swing_px;
    EXPECT_EQ(loop.swings_by, has_play ? "backlash" : "");
    if (has_play) EXPECT_NEAR(loop.swing_px, 3.6 * std::sqrt(2.0), 1.5);  // of both axes
  }
}

/// An axis has room for 32 commands on their way; more of them would act early.
TEST(ServoStability, CommandsThatAreTooLateAreRefusedByName) {
  ServoScenario scenario;
  scenario.scene.period_s = 0.01;
  for (ServoAxis& axis : scenario.scene.axes) axis.command_delay_s = 0.32;
  EXPECT_NO_THROW(require_sense(scenario));
  scenario.scene.axes[1].command_delay_s = 0.33;
  try {
    require_sense(scenario);
    ADD_FAILURE() << "33 periods late, and not refused";
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("command_delay_s: 0.33 is more than 32 periods"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace alidade
