#include "alidade/calibrate/checks/repeated_views.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "alidade/simulate/draws.h"
#include "alidade/testing/calibration_sample.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using testing::sample_calibration;

/// Every view `times` times, in turn, each corner of each with noise of its own [px].
std::vector<BoardView> standing(const std::vector<BoardView>& views, int times, double own_px, unsigned seed) {
  Draws draws(seed);
  std::vector<BoardView> all;
  for (int repeat = 0; repeat < times; ++repeat) {
    for (BoardView view : views) {
      view.photo = std::to_string(repeat) + "_" + view.photo;
      for (Corner& corner : view.corners) corner.px += own_px * Eigen::Vector2d(draws.normal(), draws.normal());
      all.push_back(std::move(view));
    }
  }
  return all;
}

std::vector<BoardView> views_of(double sigma_px, unsigned seed) {
  return simulate_views(testing::covered_scene(testing::sample_camera("brown"), 12, seed), sigma_px, seed);
}

double sigma_fx(const Calibration& calibration) { return std::sqrt(calibration.camera.cov(0, 0)); }

TEST(RepeatedViews, FramesOfABoardThatStandsCountOnce) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    const auto views = views_of(0.2, seed);
    const Calibration once = sample_calibration(views),
                      often = sample_calibration(standing(views, 6, 0.03, seed + 100));
    EXPECT_EQ(once.counts.used, 12u);
    EXPECT_EQ(often.counts.used, 12u);
    EXPECT_EQ(often.counts.given, 72u);
    EXPECT_NEAR(sigma_fx(often) / sigma_fx(once), 1.0, 0.1) << seed;
    ASSERT_EQ(often.counts.skipped.size(), 60u);
    EXPECT_THAT(often.counts.skipped.front().reason, HasSubstr("shows the board where 0_"));
    EXPECT_THAT(often.counts.skipped.front().reason, HasSubstr(" does, with the same errors"));
  }
}

TEST(RepeatedViews, FramesWithErrorsOfTheirOwnAllCount) {
  const auto exact = views_of(0.0, 4);
  const Calibration once = sample_calibration(standing(exact, 1, 0.2, 5)),
                    often = sample_calibration(standing(exact, 6, 0.2, 6));
  EXPECT_EQ(often.counts.used, 72u);
  EXPECT_LT(sigma_fx(often), 0.6 * sigma_fx(once));  // 1/√6 = 0.41, and what photos scatter
}

TEST(RepeatedViews, OfTooFewPlacesThereIsNoCamera) {
  auto views = views_of(0.2, 7);
  views.resize(2);
  const Calibration calibration = sample_calibration(standing(views, 20, 0.02, 8));
  EXPECT_EQ(calibration.verdict.exit_code, ExitCode::undetermined);
  EXPECT_THAT(calibration.verdict.sentence, HasSubstr("2 usable photos of the board (others repeat them)"));
}

}  // namespace
}  // namespace alidade
