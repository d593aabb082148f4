#include "alidade/rig/checks/repeated_stops.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "alidade/rig.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rig.h"
#include "alidade/testing/rig_sample.h"

namespace alidade {
namespace {

constexpr double sigma_rad = 3.5e-4, own_px = 0.04;

/// Every view `times` times in succession; corners and readings of each with noise of its own.
std::vector<HeadView> standing(const std::vector<HeadView>& views, int times, double own_rad, std::uint64_t seed) {
  Draws draws(seed);
  std::vector<HeadView> all;
  for (const HeadView& stop : views) {
    for (int repeat = 0; repeat < times; ++repeat) {
      HeadView view = stop;
      view.seen.photo += "_" + std::to_string(repeat);
      view.pan_tilt_rad += own_rad * Eigen::Vector2d(draws.normal(), draws.normal());
      for (Corner& corner : view.seen.corners) corner.px += own_px * Eigen::Vector2d(draws.normal(), draws.normal());
      all.push_back(std::move(view));
    }
  }
  return all;
}

RigScene scene_of(std::uint64_t seed) {
  RigSceneConfig config;
  config.num_boards = 6;
  return draw_rig_scene(config, seed);
}

RigCalibration calibrated(const RigScene& scene, std::vector<HeadView> views) {
  RigConfig config;
  config.board = scene.board;
  config.sigma_square_m = 1e-9;
  config.sigma_scale = 1e-6;
  return rig(std::move(views), testing::cameras_of(scene.rig), config);
}

TEST(RepeatedStops, TenPhotosOfAStopAreNoMoreThanOne) {
  for (const std::uint64_t seed : {1u, 2u}) {
    const RigScene scene = scene_of(seed);
    const auto views = simulate_head_views(scene, {.sigma_encoder_rad = sigma_rad}, seed).views;
    const RigCalibration once = calibrated(scene, views), often = calibrated(scene, standing(views, 10, 0.0, seed));
    ASSERT_EQ(often.status, RigReport::Status::converged);
    EXPECT_EQ(often.counts.given, 10 * views.size());
    EXPECT_EQ(often.counts.used, once.counts.used);
    EXPECT_EQ(often.counts.used + often.counts.dropped, often.counts.given);
    EXPECT_THAT(often.counts.skipped.front().reason, ::testing::HasSubstr("averaged with it"));
    EXPECT_NEAR(often.sigma_relative_m / once.sigma_relative_m, 1.0, 0.1);
    EXPECT_NEAR(often.sigma_relative_rad / once.sigma_relative_rad, 1.0, 0.1);
    EXPECT_EQ(often.verdict.state, once.verdict.state) << often.verdict.sentence;
  }
}

TEST(RepeatedStops, ReadingsWithNoiseOfTheirOwnAreAveragedAndTheirSigmaIsThatOfOne) {
  const RigScene scene = scene_of(3);
  const auto exact = simulate_head_views(scene, {.sigma_encoder_rad = 0.0}, 3).views;
  const RigCalibration better = calibrated(scene, standing(exact, 1, sigma_rad / std::sqrt(10.0), 4)),
                       often = calibrated(scene, standing(exact, 10, sigma_rad, 5));
  EXPECT_NEAR(often.sigma_relative_rad / better.sigma_relative_rad, 1.0, 0.2);
  for (const RigHead& one : often.rig.heads) EXPECT_NEAR(one.head.encoder.sigma_rad / sigma_rad, 1.0, 0.15);
}

TEST(RepeatedStops, AHeadThatComesBackMakesAnotherStop) {
  const RigScene scene = scene_of(1);
  const auto views = simulate_head_views(scene, {}, 1).views;
  EXPECT_TRUE(averaged_stops(views).repeated.empty());
  const auto again = standing(views, 1, 0.0, 2);
  auto back = views;  // after all others
  back.insert(back.end(), again.begin(), again.end());
  EXPECT_TRUE(averaged_stops(back).repeated.empty());
  EXPECT_EQ(averaged_stops(back).sigma_within_rad, 0.0);
}

TEST(RepeatedStops, AnImageThatIsGivenAgainIsNoOther) {
  const RigScene scene = scene_of(1);
  const auto views = simulate_head_views(scene, {}, 1).views;
  auto twice = views;
  for (HeadView view : views) {
    view.seen.photo += " again";
    twice.push_back(std::move(view));
  }
  const RigCalibration once = calibrated(scene, views), again = calibrated(scene, twice);
  EXPECT_EQ(again.counts.used, once.counts.used);
  EXPECT_EQ(again.counts.skipped.back().reason, "is the same image as " + views.back().seen.photo);
  EXPECT_NEAR(again.sigma_relative_m / once.sigma_relative_m, 1.0, 1e-9);
  EXPECT_EQ(again.verdict.state, once.verdict.state) << again.verdict.sentence;
}

}  // namespace
}  // namespace alidade
