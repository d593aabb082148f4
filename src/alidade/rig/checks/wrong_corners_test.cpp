#include "alidade/rig/checks/wrong_corners.h"

#include <gtest/gtest.h>

#include <set>

#include "alidade/rig.h"
#include "alidade/simulate/rangefinder.h"
#include "alidade/simulate/rig.h"
#include "alidade/testing/rig_sample.h"

// Single corners that a detector found elsewhere: they are left out, and their views are used.

namespace alidade {
namespace {

RigSceneConfig eight_boards() {
  RigSceneConfig config;
  config.num_boards = 8;
  return config;
}

std::size_t corners_of(const std::vector<HeadView>& views) {
  std::size_t num = 0;
  for (const HeadView& view : views) num += view.seen.corners.size();
  return num;
}

TEST(WrongCorners, AreLeftOutAndTheirViewsAreUsed) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const RigScene scene = draw_rig_scene(eight_boards(), seed);
    const RigNoise noise{.wrong_corners = seed % 2 == 0 ? 0.01 : 0.05};
    const std::vector<HeadView> views = simulate_head_views(scene, noise, seed).views;
    RigConfig config;
    config.board = scene.board;
    config.sigma_square_m = config.sigma_scale = 1e-9;
    const RigCalibration result = rig(views, testing::cameras_of(scene.rig), config);
    EXPECT_EQ(result.status, RigReport::Status::converged) << seed;
    EXPECT_EQ(result.views_dropped, 0) << seed;
    EXPECT_NEAR(result.sigma_px, 0.2, 0.01) << seed;
    EXPECT_GT(result.wrong_corners.size(), noise.wrong_corners * 500) << seed;
    EXPECT_GE(result.counts.skipped.size(), result.wrong_corners.size()) << seed;
    EXPECT_NE(result.wrong_corners.front().reason.find("corner"), std::string::npos);
  }
}

TEST(WrongCorners, OfViewsWithoutThemNoneIsLeftOut) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const RigScene scene = draw_rig_scene(eight_boards(), seed);
    const std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
    const CheckedCorners checked =
        without_wrong_corners(views, points_in_board(scene.board), testing::cameras_of(scene.rig));
    EXPECT_TRUE(checked.wrong.empty()) << seed;
    EXPECT_EQ(corners_of(checked.views), corners_of(views)) << seed;
  }
}

/// What a wrong lens or a bent board does to a corner it does to its neighbours, but for the outermost.
TEST(WrongCorners, ThoseOfAWrongLensOrABentBoardStay) {
  RigSceneConfig config = eight_boards();
  for (const double bend_m : {0.0, 0.003}) {
    config.board_bend_m = bend_m;
    const RigScene scene = draw_rig_scene(config, 3);
    std::map<int, Camera> cameras = testing::cameras_of(scene.rig);
    if (bend_m == 0.0) {
      Camera& camera = cameras.at(1) = with_distortion(cameras.at(1));
      Eigen::VectorXd lens = params(camera.lens);
      lens[5] += 0.4;
      camera.lens = with_params(camera.lens, lens);
    }
    const std::vector<HeadView> views = simulate_head_views(scene, {.sigma_px = 0.02}, 3).views;
    const std::vector<HeadView> left = without_wrong_corners(views, points_in_board(scene.board), cameras).views;
    EXPECT_GT(corners_of(left), 0.995 * static_cast<double>(corners_of(views))) << bend_m;
  }
}

}  // namespace
}  // namespace alidade
