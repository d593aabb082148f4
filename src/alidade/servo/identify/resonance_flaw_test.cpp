#include "alidade/servo/identify/identify_flaws.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "alidade/testing/servo_sample.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

using testing::late_scene;
using testing::log_of;

/// A drive and what swings behind it, stepped through in 10 µs by their differential equations.
TEST(ServoResonance, ResponseIsTheIntegralOfItsEquations) {
  for (const bool is_rate_plant : {false, true}) {
    const auto [log, fit] = testing::short_log_and_fit(is_rate_plant);
    const ServoFlaws flaws{.resonance_hz = 4.0, .resonance_damping = 0.07, .resonance_share = 0.8};
    const Eigen::VectorXd angles = flawed_response(log, fit, flaws);
    constexpr double dt_s = 1e-5, omega = 2.0 * std::numbers::pi * 4.0;
    double x = 0.0, v = 0.0, swung = 0.0, swung_rate = 0.0, worst = 0.0;
    std::size_t at = 0;
    for (int k = 0; at < log.size(); ++k) {
      const double t_s = k * dt_s;
      if (t_s >= log[at].t_s - 0.5 * dt_s) {
        worst = std::max(worst, std::abs(0.2 + 0.2 * x + 0.8 * swung - angles[static_cast<Eigen::Index>(at)]));
        ++at;
      }
      const auto row = static_cast<std::size_t>(std::max(0.0, std::floor((t_s - 0.083) / 0.01 + 1e-9)));
      const double goal = fit.params[0] * log[std::min(row, log.size() - 1)].command;
      v = is_rate_plant ? v + dt_s * (goal - v) / 0.1 : (goal - x) / 0.1;
      swung_rate += dt_s * (omega * omega * (x - swung) - 2.0 * 0.07 * omega * swung_rate);
      swung += dt_s * swung_rate;
      x += dt_s * v;
    }
    EXPECT_LT(worst, 2e-4) << is_rate_plant;  // Euler's own error: a step's motion, times ω over twice the damping
  }
}

struct ModeCase {
  bool is_rate_plant, is_chirp;
  Mode mode;
};

std::vector<ServoSample> log_with(const ModeCase& of, std::uint64_t seed) {
  ServoLogScene scene = late_scene(of.is_rate_plant);
  scene.is_chirp = of.is_chirp;
  scene.mode = of.mode;
  return log_of(scene, seed);
}

/// A load on a spring, and one of which a third swings: by its frequency, and the rest as if it were not there.
TEST(ServoResonance, IsEstimated) {
  constexpr std::array<ModeCase, 4> cases{{{false, false, {4.0, 0.05, 1.0}},
                                           {false, true, {8.0, 0.1, 0.3}},
                                           {true, false, {6.0, 0.04, 1.0}},
                                           {true, true, {5.0, 0.15, 0.3}}}};
  const auto draws = static_cast<std::uint64_t>(testing::trials(1));
  double sum2 = 0.0;
  int runs = 0;
  for (const ModeCase& of : cases) {
    const std::string what = std::string(of.is_rate_plant ? "rate " : "angle ") + (of.is_chirp ? "chirp" : "steps");
    for (std::uint64_t seed = 1; seed <= draws; ++seed, ++runs) {
      const std::vector<ServoSample> log = log_with(of, seed);
      const ServoIdentification identified = identify_servo(log);
      const ServoFit& fit = identified.fit;
      ASSERT_EQ(fit.kind, of.is_rate_plant ? ServoKind::rate : ServoKind::angle) << what;
      const Verdict verdict = identify_verdict(log, identified);
      ASSERT_EQ(std::ranges::count(fit.freed, std::size_t{ServoFlaw::resonance}), 1) << what << verdict.sentence;
      EXPECT_NE(verdict.sentence.find("a resonance ("), std::string::npos) << verdict.sentence;
      const ServoAxis axis = late_scene(of.is_rate_plant).axis;
      const std::array<double, 3> truth{gain_of(axis.plant), tau_of(axis.plant), 0.083};
      std::vector<double> errors;
      for (int k = 0; k < 3; ++k)
        errors.push_back((fit.params[k] - truth[static_cast<std::size_t>(k)]) / std::sqrt(fit.cov(k, k)));
      const auto add = [&](double size, std::size_t flaw) {
        errors.push_back((fit.flaws.*servo_flaws[flaw] - size) / fit.flaw_sigma[flaw]);
      };
      add(of.mode.hz, ServoFlaw::resonance);
      add(of.mode.damping, ServoFlaw::resonance_damping);
      add(of.mode.share, ServoFlaw::resonance_share);
      for (const double error : errors) {
        EXPECT_LT(std::abs(error), 4.5) << what << seed << ": " << verdict.sentence;
        sum2 += error * error / 6.0;
      }
    }
  }
  EXPECT_LT(sum2 / runs, 1.0 + 5.0 * std::sqrt(2.0 / (6.0 * runs)));
}

/// A chirp with every seventh row lost, whose commands the log lacks: that was a resonance of 9σ.
TEST(ServoResonance, LostRowsAreNone) {
  ServoLogScene scene = late_scene(false);
  scene.is_chirp = true;
  scene.sigma_rad = 0.0;
  scene.encoder_step_rad = 0.0015;
  std::vector<ServoSample> log = log_of(scene);
  std::size_t row = 0;
  std::erase_if(log, [&](const ServoSample&) { return ++row > 3 && row % 7 == 3; });
  const ServoIdentification identified = identify_servo(log);
  EXPECT_EQ(std::ranges::count(identified.fit.freed, std::size_t{ServoFlaw::resonance}), 0);
  EXPECT_LT(resonance_score(log, identified.fit, flaw_ground(log, identified.fit)).sigmas, sigmas_of_a_resonance);
}

/// An axis of the second order, a trapezoidal positioner: without a time constant. They were refused as too short or
/// too coarse a log, or told to log faster.
TEST(ServoResonance, AnAxisWithoutATimeConstantIsAnAnswer) {
  for (const double damping : {0.5, 0.9}) {
    ServoLogScene scene = late_scene(false);
    scene.axis.plant = AnglePlant{0.001, AngleUnit::rad, 1e-3};
    scene.mode = {.hz = 3.183, .damping = damping, .share = 1.0};
    scene.duration_s = 15.0;
    const std::vector<ServoSample> log = log_of(scene, 1);
    const ServoIdentification found = identify_servo(log);
    const Verdict verdict = identify_verdict(log, found);
    EXPECT_EQ(verdict.exit_code, ExitCode::ok) << verdict.sentence;
    EXPECT_EQ(verdict.sentence.find("log faster"), std::string::npos) << verdict.sentence;
    ASSERT_EQ(std::ranges::count(found.fit.freed, std::size_t{ServoFlaw::resonance}), 1) << verdict.sentence;
    EXPECT_NEAR(found.fit.flaws.resonance_hz, 3.183, 4.0 * found.fit.flaw_sigma[ServoFlaw::resonance]);
    EXPECT_LT(std::abs(testing::error_in_sigma(found.fit, scene, ServoParam::gain)), 4.0);
  }
}

TEST(ServoResonance, ATrapezoidalPositionerIsAnAnswer) {
  ServoLogScene scene = late_scene(false);
  AnglePlant plant{0.001, AngleUnit::rad, 1e-3};
  plant.max_rate_rad_s = 0.6;
  plant.max_acceleration_rad_s2 = 3.0;
  scene.axis.plant = plant;
  scene.duration_s = 15.0;
  const std::vector<ServoSample> log = log_of(scene, 1);
  const ServoIdentification found = identify_servo(log);
  const Verdict verdict = identify_verdict(log, found);
  EXPECT_EQ(verdict.exit_code, ExitCode::ok) << verdict.sentence;
  EXPECT_NEAR(found.fit.flaws.max_rate_rad_s, 0.6, 4.0 * found.fit.flaw_sigma[ServoFlaw::rate_limit]);
  EXPECT_NEAR(found.fit.flaws.max_acceleration_rad_s2, 3.0, 4.0 * found.fit.flaw_sigma[ServoFlaw::acceleration_limit]);
  for (int param = 0; param < 3; ++param) EXPECT_LT(std::abs(testing::error_in_sigma(found.fit, scene, param)), 4.0);
}

}  // namespace
}  // namespace alidade
