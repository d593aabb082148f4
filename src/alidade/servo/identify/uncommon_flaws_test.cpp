#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/identify.h"
#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/testing/servo_sample.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

using testing::late_scene;
using testing::log_of;

/// Estimates one flaw of these draws, and nothing else: good, and all within their σ.
void expect_flaw(const ServoLogScene& scene, std::size_t flaw, double truth) {
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(1)); ++seed) {
    const std::vector<ServoSample> log = log_of(scene, seed);
    const ServoIdentification found = identify_servo(log);
    const Verdict verdict = identify_verdict(log, found);
    EXPECT_EQ(verdict.state, State::good) << verdict.sentence;
    ASSERT_EQ(found.fit.freed, std::vector<std::size_t>{flaw}) << verdict.sentence;
    EXPECT_TRUE(found.slips.empty());
    EXPECT_LT(std::abs(found.fit.flaws.*servo_flaws[flaw] - truth), 4.0 * found.fit.flaw_sigma[flaw]);
    for (int param = 0; param < 3; ++param) EXPECT_LT(std::abs(testing::error_in_sigma(found.fit, scene, param)), 4.0);
  }
}

/// A driver that clips at 150 of 200: a gain that changes with the size, and a dead band, with a gain 11σ off.
TEST(ServoCauses, ALimitOfTheCommandIsEstimated) {
  for (const bool is_chirp : {false, true}) {
    ServoLogScene scene = late_scene(false);
    scene.is_chirp = is_chirp;
    scene.duration_s = 10.0;
    scene.max_command = 150.0;
    expect_flaw(scene, ServoFlaw::command_limit, 150.0);
  }
}

/// A motor whose force falls with its rate: limits of rate and acceleration, with a time constant 20σ off.
TEST(ServoCauses, ARateThatFallsBehindIsEstimated) {
  for (const bool is_rate_plant : {false, true}) {
    for (const bool is_chirp : {false, true}) {
      for (const double soft_rad_s : {2.0, 8.0}) {
        if (is_rate_plant && soft_rad_s > 2.0) continue;  // hardly another than a gain that changes with the size
        ServoLogScene scene = late_scene(is_rate_plant);
        scene.is_chirp = is_chirp;
        scene.duration_s = 10.0;
        scene.soft_max_rate_rad_s = soft_rad_s;
        expect_flaw(scene, ServoFlaw::soft_rate_limit, soft_rad_s);
      }
    }
  }
}

/// The simulated one goes in steps of 10 µs.
TEST(ServoCauses, ARateThatFallsBehindIsTheIntegralOfItsEquation) {
  ServoLogScene scene = late_scene(false);
  scene.sigma_rad = 0.0;
  scene.soft_max_rate_rad_s = 0.5;
  const std::vector<ServoSample> log = log_of(scene);
  ServoFit fit;
  fit.params << gain_of(scene.axis.plant), tau_of(scene.axis.plant), scene.axis.command_delay_s, 0.0, 0.0;
  fit.flaws.soft_max_rate_rad_s = scene.soft_max_rate_rad_s;
  EXPECT_LT(flawed_misfit(log, fit).cwiseAbs().maxCoeff(), 2e-5);
}

/// A neutral that is off: gains that differ, limits, and slips of the encoder, with a gain 7σ off.
TEST(ServoCauses, ARateBesideTheCommandsIsEstimated) {
  for (const bool is_chirp : {false, true}) {
    for (const double offset_rad_s : {0.002, -0.01, 0.05}) {
      ServoLogScene scene = late_scene(true);
      scene.is_chirp = is_chirp;
      scene.duration_s = 10.0;
      scene.rate_offset_rad_s = offset_rad_s;
      expect_flaw(scene, ServoFlaw::rate_offset, offset_rad_s);
    }
  }
}

/// An encoder whose ring is off the axis by 2 mrad passed for another gain, 9.8σ off; a chirp does not excite a mode of
/// 10 Hz, whose delay 2ζ/ω is part of the latency, 6.5σ off. Neither shows, and both are counted.
TEST(ServoCauses, WhatNoLogShowsIsCounted) {
  constexpr double eccentricity_rad = 2e-3;
  for (const double phase : {0.4, 2.0, 3.5, 5.0}) {
    const ServoLogScene scene = late_scene(false);
    std::vector<ServoSample> log = log_of(scene);
    for (ServoSample& row : log) row.angle_rad += eccentricity_rad * std::sin(row.angle_rad + phase);
    const Identification found = identify(log);
    EXPECT_LT(std::abs(testing::error_in_sigma(found.fit, scene, ServoParam::gain)), 2.5) << phase;
    const auto row = std::ranges::find(found.assumed, "encoder_eccentricity_rad", &Assumption::name);
    ASSERT_NE(row, found.assumed.end());
    EXPECT_EQ(row->moved, "gain_rad");
    EXPECT_GT(row->moves, 0.5);
  }
  for (const double hz : {10.0, 14.0}) {
    ServoLogScene scene = late_scene(false);
    scene.is_chirp = true;
    scene.duration_s = 10.0;
    scene.mode = {hz, 0.2, 0.3};
    const Identification found = identify(log_of(scene));
    for (int param = 0; param < 3; ++param)
      EXPECT_LT(std::abs(testing::error_in_sigma(found.fit, scene, param)), 3.0) << hz << " " << param;
    const auto row = std::ranges::find(found.assumed, "resonance_share", &Assumption::name);
    if (found.fit.freed.empty()) {
      ASSERT_NE(row, found.assumed.end());
      EXPECT_EQ(row->moved, "latency_s");
    }
  }
}

}  // namespace
}  // namespace alidade
