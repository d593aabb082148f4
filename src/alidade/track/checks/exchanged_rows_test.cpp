#include <gtest/gtest.h>

#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/testing/track_sample.h"
#include "alidade/testing/trials.h"
#include "alidade/track/checks/explanation.h"

namespace alidade {
namespace {

/// It was another object, a clock, a zero, degrees or a target that bounces.
TEST(ExchangedRows, AreNamedWithHeadsAndTimes) {
  const TrackScene scene = testing::three_heads();
  for (int seed = 1; seed <= testing::trials(3); ++seed) {
    std::vector<TargetObservation> observations = testing::observations_of(scene, static_cast<std::uint64_t>(seed));
    const FollowConfig config;
    EXPECT_FALSE(exchanged_rows(observations, scene.heads, config)) << seed;
    for (TargetObservation& observation : observations)
      if (observation.head < 2 && observation.t_capture_s > 4.0 && observation.t_capture_s < 5.0)
        observation.head = 1 - observation.head;
    const Verdict verdict =
        track_verdict(track_target(observations, scene.heads, config), observations, scene.heads, config);
    EXPECT_GE(verdict.state, State::bad) << seed;
    EXPECT_NE(verdict.sentence.find("the numbers of heads 1 and 2 are exchanged from "), std::string::npos)
        << seed << ": " << verdict.sentence;
    EXPECT_TRUE(verdict.to_add.starts_with("exchange the numbers of heads 1 and 2")) << verdict.to_add;
  }
}

/// Steps of 1°, for an encoder of 0.05°: they were clocks, focal lengths, degrees.
TEST(CoarseReadings, AreNamedBeforeWhatTheyPassFor) {
  TrackScene scene = testing::three_heads();
  constexpr double step_rad = 1.0 * degree;
  for (int seed = 1; seed <= testing::trials(3); ++seed) {
    std::vector<TargetObservation> observations = testing::observations_of(scene, static_cast<std::uint64_t>(seed));
    const FollowConfig config;
    EXPECT_FALSE(coarse_readings(observations, scene.heads, config)) << seed;
    for (TargetObservation& observation : observations)
      if (observation.head == 1)
        observation.pan_tilt_rad = step_rad * (observation.pan_tilt_rad / step_rad).array().round().matrix();
    const auto coarse = coarse_readings(observations, scene.heads, config);
    ASSERT_TRUE(coarse) << seed;
    EXPECT_NEAR(coarse->value, step_rad / std::sqrt(12.0), 1e-6);
    const Verdict verdict =
        track_verdict(track_target(observations, scene.heads, config), observations, scene.heads, config);
    EXPECT_NE(verdict.sentence.find("head 2 reads its "), std::string::npos) << seed << ": " << verdict.sentence;
    EXPECT_TRUE(verdict.to_add.starts_with("state sigma_rad: 0.005")) << verdict.to_add;
  }
}

}  // namespace
}  // namespace alidade
