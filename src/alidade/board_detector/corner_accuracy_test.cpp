// How well corners are found on rendered boards with exact truth; the short form of bench/corner_accuracy.cpp.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/board_detector/find_board.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"

namespace alidade {
namespace {

struct Condition {
  double blur_px, noise, max_tilt_rad;
  double goal_px;  ///< RMS per coordinate.
};

/// Ten inner corners a side and squares of 28 to 44 px where the board is nearest to facing the camera.
BoardScene accuracy_scene_of(const Condition& condition, int num_photos) {
  const Board board{BoardKind::chessboard, 10, 10, 0.02, 0.0, ""};
  constexpr double fill_per_px = 11.0 / 600.0;  // eleven squares over the image's height
  return draw_board_scene(*example_camera("brown", 800, 600), board,
                          {.num_photos = num_photos,
                           .max_tilt_rad = condition.max_tilt_rad,
                           .min_fill = 28.0 * fill_per_px,
                           .max_fill = 44.0 * fill_per_px},
                          1);
}

struct CornerScore {
  int num_found = 0, num_wrong = 0;
  double sum_squares = 0.0, sum_chi2 = 0.0;

  void add(const BoardView& view, const std::vector<Eigen::Vector2d>& truth) {
    for (const Corner& corner : view.corners) {
      const Eigen::Vector2d error = corner.px - truth[static_cast<std::size_t>(corner.index)];
      num_wrong += error.norm() > 0.5;
      sum_squares += error.squaredNorm();
      sum_chi2 += error.dot(corner.cov.inverse() * error);
      ++num_found;
    }
  }
  [[nodiscard]] double rms_px() const { return std::sqrt(sum_squares / (2 * num_found)); }
  [[nodiscard]] double error_per_sigma() const { return std::sqrt(sum_chi2 / (2 * num_found)); }
};

struct CornerAccuracy : ::testing::TestWithParam<Condition> {};

TEST_P(CornerAccuracy, ReachesItsGoalAndSaysSo) {
  constexpr int num_photos = 3;
  const BoardScene scene = accuracy_scene_of(GetParam(), num_photos);
  CornerScore score;
  for (std::size_t i = 0; i < num_photos; ++i) {
    const cv::Mat photo = render_board_photo(scene, i, {.blur_px = GetParam().blur_px, .noise = GetParam().noise}, 1);
    const BoardDetection found = find_board(photo, scene.board);
    ASSERT_TRUE(found.found()) << found.reason;
    score.add(found.view, true_corners(scene, i));
  }
  EXPECT_GE(score.num_found, 0.97 * num_photos * 100);
  EXPECT_EQ(score.num_wrong, 0);
  EXPECT_LE(score.rms_px(), GetParam().goal_px);
  EXPECT_NEAR(score.error_per_sigma(), 1.0, 0.25);
}

INSTANTIATE_TEST_SUITE_P(RenderedBoards, CornerAccuracy,
                         ::testing::Values(Condition{0.6, 2.0, 0.506, 0.009}, Condition{0.6, 6.0, 0.506, 0.014},
                                           Condition{1.5, 2.0, 0.506, 0.009}, Condition{0.6, 2.0, 1.047, 0.008}));

}  // namespace
}  // namespace alidade
