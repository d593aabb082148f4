#include "alidade/track/white_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "alidade/geometry/so3.h"
#include "alidade/testing/track_sample.h"
#include "alidade/track/track.h"

namespace alidade {
namespace {

constexpr double usual_px = 0.5;

std::optional<WhiteNoise> noise_of(std::vector<TargetObservation> observations, const std::vector<RigHead>& heads) {
  std::ranges::stable_sort(observations, {}, &TargetObservation::t_capture_s);
  TrackStep accepted;
  accepted.accepted = true;
  return white_noise(observations, heads, std::vector<TrackStep>(observations.size(), accepted), usual_px, 0.0);
}

TrackScene scene_with(const char* name, double sigma_px) {
  TrackScene scene = *track_scenario(name);
  scene.sigma_px = sigma_px;
  return scene;
}

TEST(WhiteNoise, IsThatOfThePixels) {
  for (const char* name : {"A2", "B", "C"})
    for (const double sigma_px : {0.2, 0.5, 1.0, 2.0}) {
      double mean_px = 0.0, mean_off = 0.0;
      constexpr int draws = 10;
      for (std::uint64_t seed = 1; seed <= draws; ++seed) {
        const TrackScene scene = scene_with(name, sigma_px);
        const auto found = noise_of(testing::observations_of(scene, seed), scene.heads);
        ASSERT_TRUE(found);
        EXPECT_LE(found->low_px, found->sigma_px);
        EXPECT_GT(found->high_px, found->sigma_px);
        mean_px += found->sigma_px / draws;
        mean_off += found->off_in_sigma / draws;
        if (sigma_px == usual_px) EXPECT_LT(std::abs(found->off_in_sigma), 3.0) << name << seed;
      }
      EXPECT_NEAR(mean_px, sigma_px, 0.05 * sigma_px + 0.03) << name;
      EXPECT_EQ(mean_off > 3.0, sigma_px > usual_px) << name << mean_off;
      EXPECT_EQ(mean_off < -3.0, sigma_px < usual_px) << name << mean_off;
    }
}

/// A mounting that is turned, a clock that is late, and times that scatter or are rounded make no noise across the
/// motion.
TEST(WhiteNoise, FaultsOfRigAndTimesAreNone) {
  const TrackScene scene = scene_with("B", usual_px);
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
    std::vector<RigHead> turned(scene.heads.begin(), scene.heads.end());
    turned[1].head.world_from_base.rotation = turned[1].head.world_from_base.rotation * exp_so3({0.03, 0.05, 0.02});
    std::vector<TargetObservation> late = observations, rounded = observations, scattered = observations;
    for (TargetObservation& one : late) one.t_capture_s += one.head == 1 ? 0.05 : 0.0;
    for (TargetObservation& one : rounded) one.t_capture_s = 0.03 * std::floor(one.t_capture_s / 0.03);
    for (std::size_t i = 0; i < scattered.size(); ++i)
      scattered[i].t_capture_s += 0.012 * std::sin(12.9898 * static_cast<double>(i * i));
    EXPECT_LT(std::abs(noise_of(observations, turned)->off_in_sigma), 3.0) << seed;
    EXPECT_LT(std::abs(noise_of(late, turned)->off_in_sigma), 3.0) << seed;
    for (const auto& times : {rounded, scattered}) {
      const auto found = noise_of(times, turned);
      if (found) EXPECT_LT(std::abs(found->off_in_sigma), 3.0) << seed;
    }
  }
}

TEST(WhiteNoise, RowsThatStateTheirOwnAndTooFewSayNothing) {
  const TrackScene scene = scene_with("B", usual_px);
  std::vector<TargetObservation> observations = testing::observations_of(scene, 1);
  std::vector<TargetObservation> few(observations.begin(), observations.begin() + 30);
  EXPECT_FALSE(noise_of(few, {scene.heads.begin(), scene.heads.end()}));
  for (TargetObservation& one : observations) one.sigma_px = 1.0;
  EXPECT_FALSE(noise_of(observations, {scene.heads.begin(), scene.heads.end()}));
}

TrackReport tracked(const TrackScene& scene, std::uint64_t seed, const FollowConfig& config = {}) {
  return track_target(testing::observations_of(scene, seed), scene.heads, config, testing::truth_of(scene));
}

TEST(TrackNoise, IsEstimatedWhereItIsNotTheUsual) {
  for (const char* name : {"A2", "B", "C"})
    for (const double sigma_px : {0.2, 1.0, 2.0}) {
      double mean_px = 0.0, nees = 0.0;
      constexpr int draws = 8;
      for (std::uint64_t seed = 1; seed <= draws; ++seed) {
        const TrackReport report = tracked(scene_with(name, sigma_px), seed);
        EXPECT_TRUE(report.sigma_px_is_found) << name << " " << sigma_px << " px, seed " << seed;
        EXPECT_FALSE(report.jitter) << name << " " << sigma_px << " px, seed " << seed;
        mean_px += report.sigma_px / draws;
        nees += report.nees_per_dof / draws;
      }
      EXPECT_NEAR(mean_px, sigma_px, 0.1 * sigma_px + 0.04) << name;
      EXPECT_LT(nees, 1.5) << name << " " << sigma_px;
      EXPECT_GT(nees, 0.6) << name << " " << sigma_px;
    }
}

/// Encoders that read in steps of 0.5° scatter as pixels of 0.9 px would: they are named, and not taken for noise.
TEST(TrackNoise, CoarseEncodersAreNamedInstead) {
  const TrackScene scene = scene_with("B", usual_px);
  constexpr double step_rad = 0.0087266;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    std::vector<TargetObservation> observations = testing::observations_of(scene, seed);
    for (TargetObservation& one : observations)
      one.pan_tilt_rad = step_rad * (one.pan_tilt_rad / step_rad).array().round().matrix();
    const TrackReport report = track_target(observations, scene.heads, {});
    EXPECT_FALSE(report.sigma_px_is_found) << seed;
    const Verdict verdict = track_verdict(report, observations, scene.heads, {});
    EXPECT_NE(verdict.state, State::good) << seed;
    EXPECT_NE(verdict.sentence.find("in steps of 0.5°"), std::string::npos) << verdict.sentence;
  }
}

TEST(TrackNoise, StaysWhereInnovationsAgreeOrItIsGiven) {
  FollowConfig given;
  given.find_sigma_px = false;
  for (const char* name : {"A", "B", "C", "E", "G", "throw"})
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      EXPECT_EQ(tracked(scene_with(name, usual_px), seed).sigma_px, usual_px) << name << seed;
      EXPECT_FALSE(tracked(scene_with(name, 2.0), seed, given).sigma_px_is_found) << name << seed;
    }
}

}  // namespace
}  // namespace alidade
