#include "alidade/calibrate/changes/two_lenses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "alidade/testing/calibration_sample.h"
#include "alidade/testing/trials.h"

// Photos of two lenses among each other. ALIDADE_TEST_TRIALS=20 draws as many sets of each kind.

namespace alidade {
namespace {

using testing::check_named;
using ::testing::HasSubstr;
using testing::sample_camera;

constexpr int photos_of_both = 24;

/// Views of which those of `is_other` are of a lens with so much longer a focal length.
std::vector<BoardView> mixed_views(double longer, const std::function<bool(std::size_t)>& is_other,
                                   std::uint64_t seed) {
  const Camera camera = sample_camera("brown");
  BoardScene scene = testing::covered_scene(camera, photos_of_both, seed);
  std::vector<BoardView> views = testing::sample_views(scene, seed);
  Eigen::VectorXd lens = params(camera.lens);
  lens.head<2>() *= 1.0 + longer;
  lens[2] += 5.0;
  lens[4] += 0.02;  // k1
  scene.camera.lens = with_params(camera.lens, lens);
  const std::vector<BoardView> others = testing::sample_views(scene, seed);
  for (std::size_t k = 0; k < views.size(); ++k)
    if (is_other(k)) views[k] = others[k];
  return views;
}

bool is_named(const Calibration& result) {
  return std::ranges::any_of(result.verdict.checks, [](const Check& check) { return check.name == "two lenses"; });
}

TEST(TwoLenses, AreNamedWithTheirPhotos) {
  for (const double longer : {0.03, -0.1, 0.3}) {
    for (int draw = 0; draw < testing::trials(2); ++draw) {
      const auto every_third = [](std::size_t k) { return k % 3 == 1; };
      const auto seed = static_cast<std::uint64_t>(draw + 1);
      const Calibration result = testing::sample_calibration(mixed_views(longer, every_third, seed));
      ASSERT_TRUE(is_named(result)) << longer << ": " << result.verdict.sentence;
      EXPECT_EQ(result.verdict.state, State::bad);
      EXPECT_EQ(result.verdict.exit_code, ExitCode::not_trusted);
      EXPECT_THAT(result.verdict.sentence,
                  HasSubstr("8 of " + std::to_string(result.counts.used) + " (" + result.board_views[1].photo));
      EXPECT_GE(result.counts.used, 22u);
      EXPECT_THAT(result.verdict.to_add, HasSubstr("calibrate the two apart"));
    }
  }
}

TEST(TwoLenses, EachIsThatOfItsViews) {
  const std::vector<BoardView> views = mixed_views(
      0.1, [](std::size_t k) { return k < 9; }, 3);
  const CalibrateReport report = calibrate(testing::sample_board, views, testing::sample_size, {});
  const std::vector<ViewScore> scores = view_scores(testing::sample_board, {}, views, report);
  const auto used = used_views(views, report, views.size());
  ASSERT_GE(used.size(), 22u);  // planned photos at one place share what the wrong lens does there
  const auto found = two_lenses(testing::sample_board, used, scores, {}, report);
  ASSERT_TRUE(found);
  EXPECT_THAT(found->seconds, ::testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8));
  const double fx = params(sample_camera("brown").lens)[0];
  EXPECT_NEAR(params(found->first.lens)[0], fx, 4.0 * std::sqrt(found->first.cov(0, 0)));
  EXPECT_NEAR(params(found->second.lens)[0], 1.1 * fx, 4.0 * std::sqrt(found->second.cov(0, 0)));
}

/// Neither a clean set nor one whose focal length follows the board's distance.
TEST(TwoLenses, AreNotSeenWhereThereIsOne) {
  const Camera camera = sample_camera("brown");
  for (int draw = 0; draw < testing::trials(2); ++draw) {
    const auto seed = static_cast<std::uint64_t>(draw + 1);
    BoardScene scene = testing::covered_scene(camera, photos_of_both, seed);
    EXPECT_FALSE(is_named(testing::sample_calibration(testing::sample_views(scene, seed))));
    scene.autofocus = 0.03;
    EXPECT_FALSE(is_named(testing::sample_calibration(testing::sample_views(scene, seed))));
  }
}

}  // namespace
}  // namespace alidade
