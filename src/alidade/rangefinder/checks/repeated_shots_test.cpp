#include "alidade/rangefinder/checks/repeated_shots.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "alidade/rangefinder.h"
#include "alidade/simulate/draws.h"
#include "alidade/testing/rangefinder_sample.h"

namespace alidade {
namespace {

/// Every shot `times` times in succession, each with a little noise of its own.
std::vector<Shot> standing(const std::vector<Shot>& shots, int times, std::uint64_t seed) {
  constexpr double own_px = 0.04, own_m = 4e-4;
  Draws draws(seed);
  std::vector<Shot> all;
  for (const Shot& placement : shots) {
    for (int repeat = 0; repeat < times; ++repeat) {
      Shot shot = placement;
      shot.name = placement.name + "_" + std::to_string(repeat);
      shot.range_m += own_m * draws.normal();
      shot.spot->px += own_px * Eigen::Vector2d(draws.normal(), draws.normal());
      for (Corner& corner : shot.board->corners) corner.px += own_px * Eigen::Vector2d(draws.normal(), draws.normal());
      all.push_back(std::move(shot));
    }
  }
  return all;
}

RangefinderCalibration calibrated(const testing::RangefinderSample& sample, std::vector<Shot> shots) {
  RangefinderConfig config;
  config.board = sample.scene.board;
  config.sigma_scale = config.sigma_square_m = 0.0;
  return rangefinder(std::move(shots), sample.camera, config);
}

TEST(RepeatedShots, EightReadingsOfAPlacementAreNoMoreThanOne) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const auto sample = testing::draw_rangefinder_sample(*rangefinder_scenario("reference"), {}, seed);
    const std::vector<Shot>& shots = sample.simulated.shots;
    const RangefinderCalibration once = calibrated(sample, shots), often = calibrated(sample, standing(shots, 8, seed));
    EXPECT_EQ(often.verdict.state, State::good) << often.verdict.sentence;
    EXPECT_EQ(often.counts.given, 8 * shots.size());
    EXPECT_EQ(often.counts.used, once.counts.used);
    EXPECT_EQ(often.counts.used + often.counts.dropped, often.counts.given);
    EXPECT_THAT(often.counts.skipped.front().reason, ::testing::HasSubstr("averaged with it"));
    const auto sigma = [](const RangefinderCalibration& of) {  // of origin and direction; the scale is given
      return of.beam.cov.diagonal().head<5>().array().sqrt().eval();
    };
    const Eigen::ArrayXd ratio = sigma(often) / sigma(once);
    EXPECT_NEAR(std::exp(ratio.log().mean()), 1.0, 0.2) << ratio.transpose();
  }
}

TEST(RepeatedShots, OtherPlacementsStayByThemselves) {
  const auto sample = testing::draw_rangefinder_sample(*rangefinder_scenario("reference"), {}, 1);
  std::vector<Shot> shots = sample.simulated.shots;
  EXPECT_TRUE(averaged_shots(shots).repeated.empty());
  shots.insert(shots.end(), shots.begin(), shots.end());  // held again where it was
  EXPECT_TRUE(averaged_shots(shots).repeated.empty());
  std::vector<Shot> wrong = standing({shots[0]}, 3, 1);
  wrong[1].range_m += 0.1;  // a reading that no noise explains is rejected, not averaged
  EXPECT_TRUE(averaged_shots(wrong).repeated.empty());
}

TEST(RepeatedShots, WithoutABoardNothingSaysThatItStands) {
  const auto sample = testing::draw_rangefinder_sample(*rangefinder_scenario("reference"), {}, 1);
  std::vector<Shot> spots = standing(sample.simulated.shots, 3, 1);
  for (Shot& shot : spots) shot.board.reset();
  EXPECT_TRUE(averaged_shots(spots).repeated.empty());
}

}  // namespace
}  // namespace alidade
