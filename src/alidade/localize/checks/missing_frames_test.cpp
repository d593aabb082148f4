#include "alidade/localize/checks/missing_frames.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <set>

#include "alidade/geometry/so3.h"
#include "alidade/localize.h"
#include "alidade/simulate/draws.h"
#include "alidade/testing/hover.h"
#include "alidade/testing/trials.h"

// Frames that were dropped while those behind them were numbered through.

namespace alidade {
namespace {

/// Three sines in each of the six components, and a gait: one of 1.5 to 3 Hz with its harmonics, in all of them.
struct Sway {
  explicit Sway(std::uint64_t seed, double shake = 0.0) {
    Draws draws(seed);
    for (double& value : amplitude.reshaped()) value = draws.uniform(0.01, 0.08);
    for (double& value : rate.reshaped()) value = 2.0 * std::numbers::pi * draws.uniform(0.1, 0.8);
    for (double& value : phase.reshaped()) value = draws.uniform(0.0, 2.0 * std::numbers::pi);
    for (double& value : shaken.reshaped()) value = shake * draws.normal();
    for (double& value : shaken_phase.reshaped()) value = draws.uniform(0.0, 2.0 * std::numbers::pi);
    shake_rate = 2.0 * std::numbers::pi * draws.uniform(1.5, 3.0);
  }
  [[nodiscard]] Rigid3 at(double t_s) const {
    Eigen::Vector<double, 6> x = (amplitude.array() * (rate.array() * t_s + phase.array()).sin()).rowwise().sum();
    for (int i = 0; i < 3; ++i)
      x += ((i + 1) * shake_rate * t_s + shaken_phase.col(i).array()).sin().matrix().cwiseProduct(shaken.col(i)) /
           std::pow(i + 1, 1.5);
    return {exp_so3(x.tail<3>()), x.head<3>()};
  }
  Eigen::Matrix<double, 6, 3> amplitude, rate, phase, shaken, shaken_phase;
  double shake_rate = 0.0;
};

/// 150 frames of thirty a second, numbered through; of them the indices of those that follow on what is missing.
struct Recorded {
  std::vector<PathStep> path;
  std::vector<std::size_t> behind;
};

Recorded recorded(const Sway& sway, const std::set<int>& missing, std::uint64_t seed) {
  constexpr double sigma_m = 0.5e-3, sigma_rad = 0.3e-3;
  Draws draws(seed);
  Recorded run;
  for (int k = 0; run.path.size() < 150; ++k) {
    if (missing.contains(k)) continue;
    if (missing.contains(k - 1)) run.behind.push_back(run.path.size());
    PathStep step;
    step.frame = static_cast<long>(run.path.size());
    step.t_s = static_cast<double>(step.frame) / 30.0;
    step.event = FrameEvent::tracked;
    step.world_from_cam = sway.at(k / 30.0);
    step.world_from_cam.translation += sigma_m * draws.normal3();
    step.world_from_cam.rotation = step.world_from_cam.rotation * exp_so3(sigma_rad * draws.normal3());
    run.path.push_back(step);
  }
  return run;
}

/// It stands, and goes half a metre aside within a second, as fast as a hand does.
Recorded setting_off(std::uint64_t seed) {
  Sway still(seed);
  still.amplitude.setZero();
  Recorded run = recorded(still, {}, seed);
  Draws draws(seed);
  const double from_s = draws.uniform(1.0, 3.0), for_s = draws.uniform(0.5, 1.0);
  for (PathStep& step : run.path) {
    const double u = std::clamp((step.t_s - from_s) / for_s, 0.0, 1.0);
    const double share = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
    step.world_from_cam.translation += share * Eigen::Vector3d(0.3, -0.1, 0.2);
    step.world_from_cam.rotation = step.world_from_cam.rotation * exp_so3(share * Eigen::Vector3d(0.1, 0.1, 0.0));
  }
  return run;
}

std::vector<std::size_t> found_at(const Recorded& run) {
  std::vector<std::size_t> all;
  for (const MissingFrames& each : missing_frames(run.path).frames) all.push_back(each.before);
  return all;
}

TEST(MissingFrames, OneAndSeveralAreFoundWhereTheyAre) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    EXPECT_EQ(found_at(recorded(Sway(seed), {60}, seed)), (std::vector<std::size_t>{60})) << seed;
    const Recorded run = recorded(Sway(seed), {30, 31, 32, 70, 110, 111, 112, 113, 114}, seed);
    EXPECT_EQ(found_at(run), run.behind) << seed;
    const std::vector<MissingFrames> missing = missing_frames(run.path).frames;
    constexpr std::array num{3, 1, 5};
    for (std::size_t i = 0; i < std::min<std::size_t>(missing.size(), 3); ++i)
      EXPECT_NEAR(missing[i].num, num[i], 1) << seed;
  }
}

/// Each has others around it that hide it.
TEST(MissingFrames, EveryFifthIsFound) {
  std::set<int> fifth;
  for (int k = 7; k < 250; k += 5) fifth.insert(k);
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Recorded run = recorded(Sway(seed), fifth, seed);
    EXPECT_GT(found_at(run).size(), run.behind.size() - 5) << seed;
  }
}

/// Frames that are missing where these steps come again and again.
std::set<int> missing_by(const std::vector<int>& pattern) {
  std::set<int> missing;
  for (int k = 0, at = 0; k < 300; ++k) {
    const int step = pattern[static_cast<std::size_t>(k) % pattern.size()];
    for (int i = 1; i < step; ++i) missing.insert(at + i);
    at += step;
  }
  return missing;
}

/// Between any two steps the camera goes as far in one way as in the other: also a shaken one's, of which hardly any
/// polynomial is.
TEST(MissingFrames, APatternIsFoundWhateverTheMotion) {
  int num_found = 0;
  for (const std::vector<int>& pattern : {std::vector{1, 2}, std::vector{1, 3}, std::vector{1, 1, 2}})
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      EXPECT_EQ(missing_frames(recorded(Sway(seed), missing_by(pattern), seed).path).pattern, pattern) << seed;
      const Recorded shaken = recorded(Sway(seed, 0.01), missing_by(pattern), seed);
      num_found += !missing_frames(shaken.path).pattern.empty();
    }
  EXPECT_GE(num_found, 12) << num_found;
}

/// Of whoever walks no polynomial is of a second; and none of one who sets off.
TEST(MissingFrames, SeveralAreFoundOfWhoeverWalks) {
  int num_found = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const std::vector<std::size_t> found = found_at(recorded(Sway(seed, 0.01), {60, 61, 62, 63, 64}, seed));
    num_found += found == std::vector<std::size_t>{60};
    EXPECT_LE(found.size(), 1u) << seed;
  }
  EXPECT_GE(num_found, 5) << num_found;
}

/// A camera that sways, shakes, or stands; and one whose frames bear the times at which they were taken.
TEST(MissingFrames, NoneWhereNoneIsMissing) {
  const auto num_seeds = static_cast<std::uint64_t>(testing::trials(40));
  for (std::uint64_t seed = 1; seed <= num_seeds; ++seed) {
    EXPECT_TRUE(found_at(recorded(Sway(seed), {}, seed)).empty()) << seed;
    EXPECT_TRUE(found_at(recorded(Sway(seed, 0.015), {}, seed)).empty()) << seed;
    EXPECT_TRUE(found_at(setting_off(seed)).empty()) << seed;
    Sway still(seed);
    still.amplitude.setZero();
    EXPECT_TRUE(found_at(recorded(still, {60}, seed)).empty()) << seed;
    for (const Sway& sway : {Sway(seed), Sway(seed, 0.015), still})
      EXPECT_TRUE(missing_frames(recorded(sway, {}, seed).path).pattern.empty()) << seed;
    Recorded timed = recorded(Sway(seed), {60, 61}, seed);
    for (std::size_t k = 60; k < timed.path.size(); ++k) timed.path[k].t_s += 2.0 / 30.0;
    EXPECT_TRUE(found_at(timed).empty()) << seed;
  }
}

/// At the times that its frames bear the path is up to 20σ off, and nothing else shows it.
TEST(MissingFrames, OfATableAreNamedInTheVerdict) {
  testing::Hover scene;
  scene.num_frames = 150;
  testing::HoverRun run = testing::hovering(scene, 3);
  run.camera.cov = Eigen::MatrixXd::Identity(10, 10) * 1e-12;
  LocalizeConfig config;
  config.target.points = run.target;
  EXPECT_EQ(localize(run.frames, run.camera, config).verdict.state, State::good);
  run.frames.erase(run.frames.begin() + 70, run.frames.begin() + 74);
  for (std::size_t k = 70; k < run.frames.size(); ++k) run.frames[k].t_s -= 4.0 * scene.dt_s;
  const Localization result = localize(run.frames, run.camera, config);
  EXPECT_EQ(result.verdict.state, State::care);
  EXPECT_NE(result.verdict.sentence.find("seem to be missing: before frame 74"), std::string::npos)
      << result.verdict.sentence;
}

/// A tracker that hangs gives the same pixels again: not where the points are then.
TEST(MissingFrames, RowsThatRepeatTheLastAreNoObservations) {
  testing::Hover scene;
  scene.num_frames = 90;
  testing::HoverRun run = testing::hovering(scene, 3);
  LocalizeConfig config;
  config.target.points = run.target;
  for (std::size_t k = 40; k < 46; ++k) run.frames[k].observations = run.frames[39].observations;
  const Localization result = localize(run.frames, run.camera, config);
  EXPECT_EQ(result.num_repeated, 6u);
  EXPECT_EQ(result.verdict.state, State::care);
  EXPECT_NE(result.verdict.sentence.find("6 frames are the one before them once more"), std::string::npos)
      << result.verdict.sentence;
  for (std::size_t k = 36; k < 50; ++k)
    EXPECT_LT(testing::pose_nees(result.path[k], run.truth[k].world_from_cam), 6.0) << k;
}

}  // namespace
}  // namespace alidade
