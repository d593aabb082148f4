#include "alidade/board_detector/kinds/circle_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/board_detector/find_board.h"
#include "alidade/board_detector/kinds/circle_grid_ellipse.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/testing/point_score.h"

namespace alidade {
namespace {

using testing::PointScore;

const Board symmetric{BoardKind::circles, 8, 6, 0.03, 0.015, ""};
const Board asymmetric{BoardKind::asymmetric_circles, 4, 11, 0.02, 0.014, ""};

BoardScene circle_scene_of(const Board& board, int num_photos) {
  return draw_board_scene(*example_camera("brown", 800, 600), board,
                          {.num_photos = num_photos, .max_tilt_rad = 0.6, .min_fill = 0.6}, 1);
}

TEST(CircleGrid, FindsTheImagesOfTheCentres) {
  for (const Board& board : {symmetric, asymmetric}) {
    const BoardScene scene = circle_scene_of(board, 6);
    PointScore score;
    for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
      const BoardDetection found = find_board(render_board_photo(scene, i, {}, 1), board);
      ASSERT_TRUE(found.found()) << found.reason;
      score.add(found.view, true_corners(scene, i));
    }
    EXPECT_GE(score.num_found, 0.98 * score.num_points);
    EXPECT_LT(score.rms_px(), 0.025);  // without the lens, its curvature within two pitches remains
    EXPECT_LT(score.worst_px, 0.15);
    EXPECT_NEAR(std::sqrt(score.chi2_per_dof()), 1.0,
                0.5);  // σ counts the unknown lens, which differs by board and position
  }
}

TEST(CircleGrid, RefoundCentresAreAsGoodAsTheySay) {
  for (const Board& board : {symmetric, asymmetric}) {
    const BoardScene scene = circle_scene_of(board, 6);
    PointScore score;
    for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
      const cv::Mat photo = render_board_photo(scene, i, {}, 1);
      const BoardDetection first = find_board(photo, board);
      ASSERT_TRUE(first.found()) << first.reason;
      const BoardDetection found = refind_board(photo, board, first.view, scene.camera, scene.cam_from_board[i]);
      ASSERT_TRUE(found.found()) << found.reason;
      score.add(found.view, true_corners(scene, i));
    }
    EXPECT_LT(score.rms_px(), 0.008);
    EXPECT_NEAR(score.chi2_per_dof(), 1.0, 0.5);  // 25 % in σ
  }
}

TEST(CircleGrid, MeasuresTheRadiusWhereItIsNotGiven) {
  const BoardScene scene = circle_scene_of(symmetric, 1);
  const cv::Mat photo = render_board_photo(scene, 0, {}, 1);
  Board unknown = symmetric;
  unknown.marker_m = 0.0;
  const BoardDetection with = find_board(photo, symmetric), without = find_board(photo, unknown);
  ASSERT_TRUE(with.found() && without.found()) << with.reason << without.reason;
  ASSERT_EQ(with.view.corners.size(), without.view.corners.size());
  for (std::size_t i = 0; i < with.view.corners.size(); ++i)
    EXPECT_LT((with.view.corners[i].px - without.view.corners[i].px).norm(), 0.005);
}

TEST(CircleGrid, SaysWhyThereIsNone) {
  const cv::Mat photo = render_board_photo(circle_scene_of(symmetric, 1), 0, {}, 1);
  Board other = symmetric;
  other.cols = 9;
  EXPECT_EQ(find_board(photo, other).reason, "no grid of 9×6 circles");
  EXPECT_EQ(find_board(cv::Mat(480, 640, CV_8U, cv::Scalar(120)), asymmetric).reason, "no grid of 4×11 circles");
  EXPECT_FALSE(find_board(cv::Mat(), symmetric).found());
}

TEST(Ellipse, ThroughPointsOfOne) {
  const Eigen::Matrix2d A = (Eigen::Matrix2d() << 0.02, 0.004, 0.004, 0.01).finished();
  const Eigen::Matrix2d root = Eigen::Matrix2d(A.inverse()).llt().matrixL();
  std::vector<Eigen::Vector2d> points;
  for (int k = 0; k < 9; ++k)
    points.push_back(Eigen::Vector2d(700.0, 20.0) + root * Eigen::Vector2d(std::cos(0.7 * k), std::sin(0.7 * k)));
  const auto ellipse = ellipse_through(points);
  ASSERT_TRUE(ellipse);
  EXPECT_LT((ellipse->px - Eigen::Vector2d(700.0, 20.0)).norm(), 1e-9);
  EXPECT_LT((ellipse->A - A).norm(), 1e-11);
  const std::vector<Eigen::Vector2d> line{{0, 0}, {1, 1}, {2, 2}, {3, 3}, {4, 4}};
  EXPECT_FALSE(ellipse_through(line));
}

}  // namespace
}  // namespace alidade
