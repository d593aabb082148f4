#include "alidade/track/checks/other_object.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "alidade/testing/track_sample.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

/// From 4 to 6 s head 2 sees an object that goes its own way, where its camera would see it.
void see_another(const TrackScene& scene, std::vector<TargetObservation>& observations, std::size_t head) {
  for (TargetObservation& observation : observations) {
    if (observation.head != head || observation.t_capture_s < 4.0 || observation.t_capture_s > 6.0) continue;
    const double t_s = observation.t_capture_s;
    const Eigen::Vector3d other = scene.position(t_s) + Eigen::Vector3d(0.25 + 0.05 * std::sin(t_s), 0.15, 0.2);
    const auto seen = project(scene.heads[head], observation.pan_tilt_rad, other);
    if (seen)
      observation.px += seen->px - project(scene.heads[head], observation.pan_tilt_rad, scene.position(t_s))->px;
  }
}

/// It was said that a centre, a scale or a base is off, and to calibrate the head again.
TEST(OtherObject, IsNamedWithItsRows) {
  const TrackScene scene = testing::three_heads();
  for (int seed = 1; seed <= testing::trials(3); ++seed) {
    std::vector<TargetObservation> observations = testing::observations_of(scene, static_cast<std::uint64_t>(seed));
    see_another(scene, observations, 1);
    const FollowConfig config;
    const TrackReport report = track_target(observations, scene.heads, config);
    const auto other = other_object(observations, scene.heads, config, report);
    ASSERT_TRUE(other.has_value()) << seed;
    EXPECT_EQ(other->head, 1u);
    EXPECT_NEAR(other->from_s, 4.0, 0.06);
    EXPECT_NEAR(other->until_s, 6.0, 0.06);
    const Verdict verdict = track_verdict(report, observations, scene.heads, config);
    EXPECT_TRUE(verdict.to_add.starts_with("leave out the rows of head 2 from 4.")) << verdict.to_add;
    EXPECT_NE(verdict.sentence.find("are of another object"), std::string::npos) << verdict.sentence;
  }
}

/// Rows that repeat are named as such, and not what else would explain them.
TEST(OtherObject, IsNotNamedBesideRowsThatRepeat) {
  const TrackScene scene = testing::three_heads();
  for (const double from_s : {2.0, 3.0, 4.0, 5.0, 6.0, 7.0}) {
    std::vector<TargetObservation> observations = testing::observations_of(scene, 1);
    const TargetObservation* last = nullptr;
    for (TargetObservation& observation : observations) {
      if (observation.head != 1) continue;
      if (observation.t_capture_s > from_s && observation.t_capture_s < from_s + 1.0 && last != nullptr) {
        observation.pan_tilt_rad = last->pan_tilt_rad;
        observation.px = last->px;
      } else {
        last = &observation;
      }
    }
    const FollowConfig config;
    const Verdict verdict =
        track_verdict(track_target(observations, scene.heads, config), observations, scene.heads, config);
    EXPECT_NE(verdict.sentence.find("exactly those of the row before"), std::string::npos) << verdict.sentence;
    EXPECT_TRUE(std::ranges::none_of(verdict.checks, [](const Check& one) { return one.name == "other object"; }))
        << from_s;
  }
}

/// Clocks, noise, wrong rigs and clutter do not jump there and back.
TEST(OtherObject, IsNoOtherFault) {
  const std::vector<std::function<void(TrackScene&)>> faults{
      [](TrackScene&) {},
      [](TrackScene& scene) { scene.faults.clock_s = 0.04; },
      [](TrackScene& scene) { scene.faults.base_turn_rad.x() = 0.01; },
      [](TrackScene& scene) { scene.faults.clutter = 0.1; },
      [](TrackScene& scene) { scene.faults.mirrored = true; },
      [](TrackScene& scene) { scene.sigma_px = 1.5; }};
  for (const char* name : {"B", "C", "D", "throw"})
    for (std::size_t k = 0; k < faults.size(); ++k) {
      TrackScene scene = *track_scenario(name);
      faults[k](scene);
      const std::vector<TargetObservation> observations = testing::observations_of(scene, 5);
      const FollowConfig config;
      const TrackReport report = track_target(observations, scene.heads, config);
      const Verdict verdict = track_verdict(report, observations, scene.heads, config);
      EXPECT_EQ(verdict.sentence.find("another object"), std::string::npos) << name << k << verdict.sentence;
    }
}

}  // namespace
}  // namespace alidade
