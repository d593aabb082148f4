#include "alidade/calibrate/changes/rolling_shutter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "alidade/simulate/draws.h"
#include "alidade/testing/calibration_sample.h"
#include "alidade/testing/trials.h"

// Photos whose rows are read one after the other while the board moves. ALIDADE_TEST_TRIALS=20 draws as many sets.

namespace alidade {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::sample_camera;

/// The view's corners where they are when their row is read; `moved_m`: from the first row to the last.
void move_while_read(const BoardScene& scene, std::size_t photo, const Eigen::Vector3d& moved_m, BoardView& view) {
  const std::vector<Eigen::Vector3d> points = points_in_board(testing::sample_board);
  for (Corner& corner : view.corners) {
    const Eigen::Vector3d in_cam = scene.cam_from_board[photo] * points[static_cast<std::size_t>(corner.index)];
    const Eigen::Vector2d still = *project(scene.camera, in_cam), noise = corner.px - still;
    Eigen::Vector2d seen = still;
    for (int i = 0; i < 4; ++i)
      seen = *project(scene.camera, in_cam + (seen.y() / testing::sample_size.height_px - 0.5) * moved_m);
    corner.px = seen + noise;
  }
}

/// 24 photos, each with a motion of its own: σ of it, a coordinate.
Calibration calibrated_moving(double sigma_m, int draw) {
  const auto seed = static_cast<std::uint64_t>(draw + 1);
  const BoardScene scene = testing::covered_scene(sample_camera("brown"), 24, seed);
  std::vector<BoardView> views = testing::sample_views(scene, seed);
  Draws draws(200 + seed);
  for (std::size_t k = 0; k < views.size(); ++k) {
    const Eigen::Vector3d moved_m = sigma_m * Eigen::Vector3d(draws.normal(), draws.normal(), draws.normal());
    move_while_read(scene, k, moved_m, views[k]);
  }
  return testing::sample_calibration(views);
}

TEST(RollingShutter, IsNamedWhereBoardsMove) {
  for (int draw = 0; draw < testing::trials(3); ++draw) {
    const Calibration result = calibrated_moving(0.004, draw);
    EXPECT_NE(result.verdict.state, State::good);
    EXPECT_THAT(result.verdict.sentence, HasSubstr("rolling shutter reads the rows"));
    EXPECT_THAT(result.verdict.to_add, HasSubstr("hold board and camera still"));
    EXPECT_THAT(result.verdict.sentence, Not(HasSubstr("the centre differs")));
    EXPECT_THAT(result.verdict.sentence, Not(HasSubstr("jumps")));
  }
}

TEST(RollingShutter, LeavesTheCornersNoise) {
  const Calibration result = calibrated_moving(0.004, 0);
  const auto motion = readout_motion(result.board_views, result);
  ASSERT_TRUE(motion);
  EXPECT_NEAR(motion->after_px, 0.1, 0.03);
  EXPECT_GT(motion->before_px, 0.2);
}

TEST(RollingShutter, IsNotSeenWhereNothingMoves) {
  for (int draw = 0; draw < testing::trials(3); ++draw) {
    const Calibration result = calibrated_moving(0.0, draw);
    EXPECT_FALSE(readout_motion(result.board_views, result));
  }
}

}  // namespace
}  // namespace alidade
