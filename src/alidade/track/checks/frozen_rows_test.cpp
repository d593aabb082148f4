#include "alidade/track/checks/frozen_rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/testing/track_sample.h"
#include "alidade/testing/trials.h"
#include "alidade/track/track.h"

namespace alidade {
namespace {

std::vector<TargetObservation> sorted_sample(const TrackScene& scene, std::uint64_t seed) {
  std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
  std::ranges::stable_sort(observations, {}, &TargetObservation::t_capture_s);
  return observations;
}

/// From 5 to 6 s what the head says is what it said before.
void freeze(std::vector<TargetObservation>& observations, bool pixels) {
  const TargetObservation* last = nullptr;
  for (TargetObservation& observation : observations) {
    if (observation.head != 1) continue;
    if (observation.t_capture_s > 5.0 && observation.t_capture_s < 6.0 && last != nullptr)
      (pixels ? observation.px : observation.pan_tilt_rad) = pixels ? last->px : last->pan_tilt_rad;
    else
      last = &observation;
  }
}

TEST(FrozenRows, AreNamedWithTheirTime) {
  const TrackScene scene = *track_scenario("C");
  for (const bool pixels : {true, false}) {
    for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(4)); ++seed) {
      std::vector<TargetObservation> observations = sorted_sample(scene, seed);
      freeze(observations, pixels);
      const auto frozen = frozen_rows(observations, 2);
      ASSERT_TRUE(frozen.has_value()) << pixels << seed;
      EXPECT_EQ(frozen->head, 1u);
      EXPECT_EQ(frozen->is_of_pixels, pixels);
      EXPECT_GE(frozen->num, 18u);
      EXPECT_NEAR(frozen->from_s, 5.0, 0.11);
      EXPECT_NEAR(frozen->until_s, 6.0, 0.11);
    }
  }
}

/// Two of eight such tracks were good, up to 10σ off; the others named a focal length or a clock.
TEST(FrozenRows, AreTheVerdictsCause) {
  const TrackScene scene = *track_scenario("C");
  std::vector<TargetObservation> observations = sorted_sample(scene, 3);
  freeze(observations, true);
  const FollowConfig config;
  const TrackReport report = track_target(observations, scene.heads, config);
  const Verdict verdict = track_verdict(report, observations, scene.heads, config);
  EXPECT_EQ(verdict.state, State::care) << verdict.sentence;
  EXPECT_NE(verdict.sentence.find("the pixels of head 2 are exactly those of the row before"), std::string::npos)
      << verdict.sentence;
  EXPECT_TRUE(verdict.to_add.starts_with("leave out the rows of head 2")) << verdict.to_add;
}

/// Noise repeats nothing; whole pixels of a target at rest, and the angles of a head that rests, do.
TEST(FrozenRows, RestIsNone) {
  for (const char* name : {"A", "B", "C", "G"}) {
    const TrackScene scene = *track_scenario(name);
    for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(4)); ++seed) {
      std::vector<TargetObservation> observations = sorted_sample(scene, seed);
      EXPECT_FALSE(frozen_rows(observations, 2).has_value()) << name << seed;
      for (TargetObservation& observation : observations) {
        observation.px = observation.px.array().round();
        // At rest until 3 s, then slowly off; encoders without noise.
        const double since_s = std::max(0.0, observation.t_capture_s - 3.0);
        observation.pan_tilt_rad = Eigen::Vector2d(0.1 * since_s * since_s / (1.0 + since_s), 0.05 * std::sin(since_s));
      }
      EXPECT_FALSE(frozen_rows(observations, 2).has_value()) << name << seed;
    }
  }
}

}  // namespace
}  // namespace alidade
