#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "alidade/testing/track_sample.h"
#include "alidade/track/checks/lean.h"
#include "alidade/track/checks/track_assumed.h"
#include "alidade/track/track.h"

// What is supposed where nothing is stated: pixels' noise, and when angles were read.

namespace alidade {
namespace {

/// All heads' angles as they were so much before: a slope between the readings beside each.
std::vector<TargetObservation> with_late_angles(const std::vector<TargetObservation>& observations, double late_s) {
  std::vector<TargetObservation> late = observations;
  for (std::size_t i = 2; i + 2 < observations.size(); ++i) {
    const TargetObservation &before = observations[i - 2], &after = observations[i + 2];  // of two heads in turn
    if (before.head != observations[i].head || after.head != observations[i].head) continue;
    const double apart_s = after.t_capture_s - before.t_capture_s;
    late[i].pan_tilt_rad -= late_s / apart_s * (after.pan_tilt_rad - before.pan_tilt_rad);
  }
  return late;
}

double nees_of(double sigma_delay_s, double stated_s, std::uint64_t seed) {
  const TrackScene scene = *track_scenario("B");
  std::mt19937_64 random(seed);
  const double delay_s = sigma_delay_s * std::normal_distribution<>()(random);
  FollowConfig config;
  config.find_sigma_a = config.find_sigma_px = false;
  config.tracker.sigma_a_m_s2 = scene.sigma_a_m_s2;
  config.sigma_clock_s = stated_s;
  const auto observations = with_late_angles(testing::observations_of(scene, seed), delay_s);
  return track_target(observations, scene.heads, config, testing::truth_of(scene)).nees_per_dof;
}

/// Late angles are in no innovation where heads follow; σ has them where their delay is stated.
TEST(AngleDelay, IsCountedWhereItIsStated) {
  constexpr double sigma_s = 0.01;
  constexpr int num = 40;
  double counted = 0.0, exact = 0.0;
  for (std::uint64_t seed = 1; seed <= num; ++seed) {
    counted += nees_of(sigma_s, sigma_s, seed) / num;
    exact += nees_of(sigma_s, 0.0, seed) / num;
  }
  EXPECT_GT(exact, 2.0);
  EXPECT_LT(counted, 1.5);
  EXPECT_GT(counted, 0.6);
}

TEST(AngleDelay, HasAStatedSigmaAmongTheAssumptions) {
  const TrackScene scene = *track_scenario("B");
  const auto observations = testing::observations_of(scene, 3);
  const TrackReport report = track_target(observations, scene.heads, {});
  const auto unstated = angles_assumed(observations, scene.heads, report, 0.0);
  ASSERT_EQ(unstated.size(), 2u);
  EXPECT_FALSE(unstated[0].sigma);
  EXPECT_NE(unstated[0].remedy.find("--sigma-clock"), std::string::npos);
  const auto stated = angles_assumed(observations, scene.heads, report, 0.0005);
  for (const Assumption& row : stated) EXPECT_EQ(row.sigma, 0.0005) << row.name;
  EXPECT_NEAR(stated[0].moves, 0.5 * unstated[0].moves, 1e-12);
  EXPECT_EQ(assumed_check(stated).state, State::good) << assumed_check(stated).text;
}

TEST(SupposedNoise, ThatIsSmallerIsNoDoubt) {
  TrackReport report;
  report.sigma_px = 0.5;
  report.nis_per_dof = 0.45;
  EXPECT_EQ(nis_check(report, /*is_stated=*/true).state, State::care);
  EXPECT_EQ(nis_check(report, /*is_stated=*/false).state, State::good);
  EXPECT_NE(nis_check(report, /*is_stated=*/false).text.find("smaller than the 0.5 px supposed"), std::string::npos);
  report.nis_per_dof = 1.6;
  EXPECT_EQ(nis_check(report, /*is_stated=*/false).state, State::care);
}

/// Short tracks of 0.3 px: σ of a pixel is found, or its lack is no doubt, and σ of the track stays honest.
TEST(SupposedNoise, OfShortTracksIsFoundOrNoDoubt) {
  TrackScene scene = *track_scenario("B");
  scene.sigma_px = 0.3;
  double nees = 0.0;
  constexpr int num = 12;
  int num_found = 0;
  for (std::uint64_t seed = 1; seed <= num; ++seed) {
    std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
    for (TargetObservation& each : observations) each.sigma_px = 0.0;
    observations.resize(std::min<std::size_t>(observations.size(), 200));
    const TrackReport report = track_target(observations, scene.heads, {}, testing::truth_of(scene));
    nees += report.nees_per_dof / num;
    num_found += report.sigma_px_is_found ? 1 : 0;
    const Verdict verdict = track_verdict(report, observations, scene.heads, {});
    EXPECT_EQ(verdict.state, State::good) << seed << ": " << verdict.sentence;
  }
  EXPECT_GE(num_found, num / 2);
  EXPECT_LT(nees, 1.4);
}

}  // namespace
}  // namespace alidade
