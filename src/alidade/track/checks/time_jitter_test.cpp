#include "alidade/track/checks/time_jitter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/simulate/draws.h"
#include "alidade/testing/track_sample.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

struct JudgedTimes {
  TrackReport report;
  Verdict verdict;
};

/// Times that scatter by so much about the true ones.
JudgedTimes judged(const TrackScene& scene, double jitter_s, std::uint64_t seed, const FollowConfig& config = {}) {
  std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
  Draws draws(seed + 1000);
  for (TargetObservation& observation : observations) {
    observation.t_capture_s += jitter_s * draws.normal();
    observation.t_arrival_s = observation.t_capture_s;
  }
  std::ranges::stable_sort(observations, {}, &TargetObservation::t_capture_s);
  JudgedTimes result;
  result.report = track_target(observations, scene.heads, config);
  result.verdict = track_verdict(result.report, observations, scene.heads, config);
  return result;
}

/// It was called a target that falls, a clock, or images that are rotated by half a turn.
TEST(TimeJitter, IsNamedWithItsSize) {
  constexpr double jitter_s = 0.01;
  for (const char* name : {"C", "G"}) {
    for (int seed = 1; seed <= testing::trials(3); ++seed) {
      const JudgedTimes with = judged(*track_scenario(name), jitter_s, static_cast<std::uint64_t>(seed));
      ASSERT_TRUE(with.report.jitter.has_value()) << name << seed;
      EXPECT_NEAR(with.report.jitter->sigma_s, jitter_s, 0.5 * jitter_s) << name << seed;
      EXPECT_EQ(with.verdict.state, State::care) << with.verdict.sentence;
      EXPECT_NE(with.verdict.sentence.find("capture times scatter by"), std::string::npos) << with.verdict.sentence;
      EXPECT_TRUE(with.verdict.to_add.starts_with("write when each image was taken")) << with.verdict.to_add;
    }
  }
}

/// Right times have none, nor has a clock that is off by a constant, noise that is larger than stated, or a rig whose
/// errors are counted.
TEST(TimeJitter, IsNoOtherFault) {
  for (const char* name : {"A", "B", "C", "E", "G", "throw"}) {
    for (int seed = 1; seed <= testing::trials(3); ++seed) {
      const auto draw = static_cast<std::uint64_t>(seed);
      TrackScene scene = *track_scenario(name);
      EXPECT_FALSE(judged(scene, 0.0, draw).report.jitter.has_value()) << name << seed;
      scene.faults.clock_s = 0.04;
      EXPECT_FALSE(judged(scene, 0.0, draw).report.jitter.has_value()) << name << seed << " clock";
      scene.faults = {};
      scene.sigma_px = 1.0;
      EXPECT_FALSE(judged(scene, 0.0, draw).report.jitter.has_value()) << name << seed << " noise";
    }
  }
}

/// Where the rig's errors are counted, innovations are those of a filter that learns them.
TEST(TimeJitter, IsFoundBesideErrorsOfTheRig) {
  const TrackScene scene = *track_scenario("G");
  Rig rig;
  rig.heads = scene.heads;
  rig.encoder_errors.assign(2, {.sigma_zero_rad = 0.002, .sigma_scale = 0.002});
  rig.cov.setZero(2 * num_head_params, 2 * num_head_params);
  FollowConfig config;
  config.tracker.errors = rig_uncertainty(rig);
  ASSERT_GT(config.tracker.errors.num(), 0);
  EXPECT_TRUE(judged(scene, 0.015, 1, config).report.jitter.has_value());
  EXPECT_FALSE(judged(scene, 0.0, 1, config).report.jitter.has_value());
}

}  // namespace
}  // namespace alidade
