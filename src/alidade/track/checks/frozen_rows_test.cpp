#include "alidade/track/checks/frozen_rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/testing/track_sample.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

enum class What { pixels, angles, pan, all };

std::vector<TargetObservation> sorted_sample(const TrackScene& scene, std::uint64_t seed) {
  std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
  std::ranges::stable_sort(observations, {}, &TargetObservation::t_capture_s);
  return observations;
}

/// From 5 s on what head 2 says is what it said before.
void freeze(std::vector<TargetObservation>& observations, What what, double until_s) {
  const TargetObservation* last = nullptr;
  for (TargetObservation& observation : observations) {
    if (observation.head != 1) continue;
    if (!(observation.t_capture_s > 5.0 && observation.t_capture_s < until_s && last != nullptr)) {
      last = &observation;
      continue;
    }
    if (what == What::pixels || what == What::all) observation.px = last->px;
    if (what == What::angles || what == What::all) observation.pan_tilt_rad = last->pan_tilt_rad;
    if (what == What::pan) observation.pan_tilt_rad.x() = last->pan_tilt_rad.x();
  }
}

void round_to(std::vector<TargetObservation>& observations, double step_px, double step_rad) {
  for (TargetObservation& observation : observations) {
    if (step_px > 0.0) observation.px = (observation.px / step_px).array().round() * step_px;
    if (step_rad > 0.0) observation.pan_tilt_rad = (observation.pan_tilt_rad / step_rad).array().round() * step_rad;
  }
}

constexpr double step_of_4096 = 2.0 * std::numbers::pi / 4096.0;

/// The path of scenario C, which stands still from 4 to 7 s.
TrackScene resting_scene() {
  TrackScene scene = *track_scenario("C");
  const auto moving = scene.position;
  scene.position = [moving](double t_s) {
    constexpr double from_s = 4.0, until_s = 7.0, slowing_s = 0.5;  // its speed falls and rises linearly
    const double slows = std::clamp(t_s - from_s + slowing_s, 0.0, slowing_s);
    const double starts = std::clamp(t_s - until_s, 0.0, slowing_s);
    const double lost = slows * slows / (2.0 * slowing_s) + std::clamp(t_s - from_s, 0.0, until_s - from_s) + starts -
                        starts * starts / (2.0 * slowing_s);
    return moving(t_s - lost);
  };
  scene.duration_s += 3.0;
  return scene;
}

double worst_in_sigma(const TrackScene& scene, const TrackReport& report) {
  double worst = 0.0;
  for (const TrackStep& step : report.steps) {
    if (!step.has_belief || step.t_s < 1.5) continue;
    const Eigen::Vector3d error = step.belief.x.head<3>() - scene.position(step.t_s);
    for (int k = 0; k < 3; ++k) worst = std::max(worst, std::abs(error[k]) / std::sqrt(step.belief.P(k, k)));
  }
  return worst;
}

/// Also where pixels or encoders are rounded: then rows before repeat by chance, and of one angle alone the others
/// contradict fewer.
TEST(FrozenRows, AreNamedWithTheirTime) {
  const TrackScene scene = *track_scenario("C");
  for (const double rounded : {0.0, 1.0})
    for (const What what : {What::pixels, What::angles, What::all, What::pan}) {
      if (rounded > 0.0 && what == What::pan) continue;
      for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(3)); ++seed) {
        std::vector<TargetObservation> observations = sorted_sample(scene, seed);
        round_to(observations, rounded, rounded * step_of_4096);
        freeze(observations, what, 6.5);
        const auto frozen = frozen_rows(observations, scene.heads, {});
        ASSERT_EQ(frozen.size(), 1u) << rounded << static_cast<int>(what) << seed;
        EXPECT_EQ(frozen[0].head, 1u);
        EXPECT_EQ(frozen[0].pixels, what == What::pixels || what == What::all);
        EXPECT_EQ(frozen[0].pan || frozen[0].tilt, what != What::pixels);
        if (rounded == 0.0) EXPECT_EQ(frozen[0].tilt, what == What::angles || what == What::all);
        EXPECT_GE(frozen[0].num, 27u);
        EXPECT_NEAR(frozen[0].from_s, 5.0, rounded > 0.0 ? 0.31 : 0.11);
        EXPECT_NEAR(frozen[0].until_s, 6.5, 0.11);
      }
    }
}

/// Such tracks of two heads were up to 47σ off where they were followed, of three 23σ, and named a focal length or a
/// clock.
TEST(FrozenRows, AreKeptOut) {
  const TrackScene scene = testing::three_heads();
  for (const What what : {What::pixels, What::angles, What::all})
    for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(3)); ++seed) {
      std::vector<TargetObservation> observations = sorted_sample(scene, seed);
      freeze(observations, what, 6.0);
      const FollowConfig config;
      const TrackReport report = track_target(observations, scene.heads, config);
      ASSERT_EQ(report.steps.size(), observations.size());
      EXPECT_GE(std::ranges::count(report.steps, TrackEvent::frozen, &TrackStep::event), 18);
      EXPECT_LT(worst_in_sigma(scene, report), 5.0) << static_cast<int>(what) << seed;
      const Verdict verdict = track_verdict(report, observations, scene.heads, config);
      EXPECT_EQ(verdict.state, State::care) << verdict.sentence;
      EXPECT_EQ(std::ranges::count_if(verdict.checks, [](const Check& one) { return one.state != State::good; }), 1)
          << verdict.sentence;
      EXPECT_NE(verdict.sentence.find("of head 2 are exactly those of the row before"), std::string::npos)
          << verdict.sentence;
      EXPECT_TRUE(verdict.to_add.starts_with("find out what stood still in head 2 from 5.")) << verdict.to_add;
    }
}

/// The track is that of a log that never had them, also where rows come in another order than they were taken.
TEST(FrozenRows, AreAsIfNeverGiven) {
  for (const char* name : {"C", "F"}) {
    const TrackScene scene = *track_scenario(name);
    std::vector<TargetObservation> observations = sorted_sample(scene, 1), others;
    freeze(observations, What::all, 6.0);
    std::ranges::stable_sort(observations, {}, &TargetObservation::t_arrival_s);
    const TrackReport report = track_target(observations, scene.heads, {});
    std::vector<TrackStep> followed;
    for (std::size_t i = 0; i < observations.size(); ++i) {
      if (report.steps[i].event == TrackEvent::frozen) continue;
      followed.push_back(report.steps[i]);
      others.push_back(observations[i]);
    }
    ASSERT_LT(others.size() + 17, observations.size());
    const TrackReport without = track_target(others, scene.heads, {});
    ASSERT_EQ(without.steps.size(), followed.size());
    for (std::size_t i = 0; i < followed.size(); ++i) {
      EXPECT_EQ(without.steps[i].belief.x, followed[i].belief.x);
      EXPECT_EQ(without.steps[i].belief.P, followed[i].belief.P);
    }
  }
}

/// Nothing is named where target or heads rest: pixels with noise, whole ones, encoders with noise, rounded, exact.
TEST(FrozenRows, RestIsNone) {
  std::vector<TrackScene> scenes{resting_scene()};
  for (const char* name : {"A", "B", "C", "G", "throw"}) scenes.push_back(*track_scenario(name));
  for (std::size_t s = 0; s < scenes.size(); ++s)
    for (const double noise_rad : {scenes[s].sigma_encoder_rad, 0.0})
      for (const double rounded : {0.0, 1.0})
        for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(3)); ++seed) {
          TrackScene scene = scenes[s];
          scene.sigma_encoder_rad = noise_rad;
          std::vector<TargetObservation> observations = sorted_sample(scene, seed);
          round_to(observations, rounded, rounded * step_of_4096);
          for (const FrozenRows& one : frozen_rows(observations, scene.heads, {}))
            ADD_FAILURE() << s << " " << noise_rad << " " << rounded << " " << seed << ": "
                          << frozen_text(one, scene.heads);
        }
}

/// A head whose drive holds it: its angles repeat exactly, without noise, while the target goes on in its image.
TEST(FrozenRows, AHeadAtRestIsNone) {
  TrackScene scene = *track_scenario("C");
  scene.sigma_encoder_rad = 0.0;
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(4)); ++seed) {
    std::vector<TargetObservation> observations = sorted_sample(scene, seed);
    std::optional<Eigen::Vector2d> held;
    for (TargetObservation& observation : observations) {
      if (observation.head != 1 || observation.t_capture_s < 5.0 || observation.t_capture_s > 6.0) continue;
      if (!held) held = observation.pan_tilt_rad;
      const Eigen::Vector3d at = scene.position(observation.t_capture_s);
      const auto there = project(scene.heads[1], observation.pan_tilt_rad, at),
                 here = project(scene.heads[1], *held, at);
      ASSERT_TRUE(there && here);
      observation.px += here->px - there->px;
      observation.pan_tilt_rad = *held;
    }
    EXPECT_TRUE(frozen_rows(observations, scene.heads, {}).empty()) << seed;
  }
}

/// Video of a target at rest may be compressed to the same image again and again: that is no fault.
TEST(FrozenRows, OfATargetAtRestAreNoFault) {
  const TrackScene scene = resting_scene();
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(3)); ++seed) {
    std::vector<TargetObservation> observations = sorted_sample(scene, seed);
    std::optional<Eigen::Vector2d> held;
    for (TargetObservation& observation : observations) {
      if (observation.head != 1 || observation.t_capture_s < 6.0 || observation.t_capture_s > 7.0) continue;
      if (!held) held = observation.px;
      observation.px = *held;
    }
    const FollowConfig config;
    const TrackReport report = track_target(observations, scene.heads, config);
    ASSERT_EQ(report.frozen.size(), 1u);
    EXPECT_TRUE(report.frozen[0].agrees);
    const Verdict verdict = track_verdict(report, observations, scene.heads, config);
    EXPECT_TRUE(std::ranges::none_of(verdict.checks, [](const Check& one) {
      return one.state != State::good && one.name == "frozen";
    })) << verdict.sentence;
  }
}

}  // namespace
}  // namespace alidade
