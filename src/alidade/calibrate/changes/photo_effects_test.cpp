#include "alidade/calibrate/changes/photo_effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/simulate/draws.h"
#include "alidade/testing/calibration_sample.h"
#include "alidade/testing/trials.h"

// A lens that differs from photo to photo. ALIDADE_TEST_TRIALS=20 draws as many sets of each kind.

namespace alidade {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::sample_camera;

/// Views of lenses whose centre and focal length scatter by so much about the example's.
Calibration scattered(double centre_px, double focal, int draw) {
  const auto seed = static_cast<std::uint64_t>(draw + 1);
  const Camera camera = sample_camera("brown");
  BoardScene scene = testing::covered_scene(camera, 24, seed);
  std::vector<BoardView> views = testing::sample_views(scene, seed);
  Draws draws(100 + seed);
  for (std::size_t k = 0; k < views.size(); ++k) {
    Eigen::VectorXd lens = params(camera.lens);
    lens.head<2>() *= 1.0 + focal * draws.normal();
    lens[2] += centre_px * draws.normal();
    lens[3] += centre_px * draws.normal();
    scene.camera.lens = with_params(camera.lens, lens);
    views[k] = testing::sample_views(scene, seed)[k];
  }
  return testing::sample_calibration(views);
}

const Check* found_in(const Verdict& verdict) {
  const auto at = std::ranges::find(verdict.checks, "photo to photo", &Check::name);
  return at == verdict.checks.end() ? nullptr : &*at;
}

TEST(PhotoEffects, AStabiliserIsNamed) {
  for (int draw = 0; draw < testing::trials(3); ++draw) {
    const Calibration result = scattered(10.0, 0.0, draw);
    ASSERT_NE(found_in(result.verdict), nullptr) << result.verdict.sentence;
    EXPECT_THAT(found_in(result.verdict)->text, HasSubstr("the centre differs from photo to photo"));
    EXPECT_THAT(result.verdict.to_add, HasSubstr("stabilisation"));
  }
}

// Of 24 photos that scatter, the order of one set in 24 shows a jump by chance, which was named in its stead.
TEST(PhotoEffects, AJumpThatTheOrderShowsByChanceIsNotNamed) {
  constexpr int draw = 12;
  for (const Calibration& result : {scattered(10.0, 0.0, draw), scattered(0.0, 0.02, draw)}) {
    EXPECT_NE(found_in(result.verdict), nullptr) << result.verdict.sentence;
    EXPECT_THAT(result.verdict.sentence, Not(HasSubstr("jumps")));
    EXPECT_EQ(result.verdict.state, State::care);
  }
}

TEST(PhotoEffects, AnAutofocusThatSearchesIsNamed) {
  for (int draw = 0; draw < testing::trials(3); ++draw) {
    const Calibration result = scattered(0.0, 0.02, draw);
    ASSERT_NE(found_in(result.verdict), nullptr) << result.verdict.sentence;
    EXPECT_THAT(found_in(result.verdict)->text, HasSubstr("the focal length differs from photo to photo"));
    EXPECT_THAT(result.verdict.to_add, HasSubstr("autofocus"));
  }
}

TEST(PhotoEffects, TheScatterIsThatOfTheLenses) {
  double centre2 = 0.0;
  constexpr int draws = 4;
  for (int draw = 0; draw < draws; ++draw) {
    const Calibration result = scattered(10.0, 0.0, draw);
    const auto scores = view_scores(testing::sample_board, {}, result.board_views, result);
    const auto effect = photo_effect(scores, result);
    ASSERT_TRUE(effect);
    centre2 += effect->scatter * effect->scatter / draws;
  }
  EXPECT_NEAR(std::sqrt(centre2), 10.0, 3.0);  // of 4 × 24 × 2, of which a few photos tell most
}

TEST(PhotoEffects, NothingIsSeenWhereNothingDiffers) {
  for (int draw = 0; draw < testing::trials(3); ++draw) {
    const Calibration result = scattered(0.0, 0.0, draw);
    EXPECT_EQ(found_in(result.verdict), nullptr) << result.verdict.sentence;
    EXPECT_FALSE(photo_effect(view_scores(testing::sample_board, {}, result.board_views, result), result));
  }
}

}  // namespace
}  // namespace alidade
