#include "alidade/board_detector/kinds/marker_board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/board_detector/find_board.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/testing/point_score.h"

namespace alidade {
namespace {

using testing::PointScore;

const Board charuco{BoardKind::charuco, 8, 5, 0.03, 0.022, "DICT_5X5_100"};
const Board aprilgrid{BoardKind::aprilgrid, 6, 5, 0.03, 0.009, ""};

BoardScene scene_of(const Board& board, int num_photos) {
  return draw_board_scene(*example_camera("brown", 800, 600), board,
                          {.num_photos = num_photos, .max_tilt_rad = 0.6, .min_fill = 0.5}, 1);
}

TEST(MarkerBoard, FindsThePointsAsWellAsItSays) {
  for (const Board& board : {charuco, aprilgrid}) {
    const BoardScene scene = scene_of(board, 8);
    PointScore score;
    for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
      const BoardDetection found = find_board(render_board_photo(scene, i, {}, 1), board);
      ASSERT_TRUE(found.found()) << found.reason;
      score.add(found.view, true_corners(scene, i));
    }
    EXPECT_GE(score.num_found, 0.98 * score.num_points);
    EXPECT_LT(score.rms_px(), 0.015);  // the clear space around a point is a third of a chessboard's
    EXPECT_LT(score.worst_px, 0.1);
    EXPECT_NEAR(score.chi2_per_dof(), 1.0, 0.5);  // 25 % in σ
  }
}

TEST(MarkerBoard, TakesAPartForWhatItIs) {
  for (const Board& board : {charuco, aprilgrid}) {
    const BoardScene scene = scene_of(board, 3);
    PointScore score;
    for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
      cv::Mat photo = render_board_photo(scene, i, {}, 1);
      const std::vector<Eigen::Vector2d> truth = true_corners(scene, i);
      const Eigen::Vector2d centre = 0.5 * (truth.front() + truth.back());
      photo.colRange(0, static_cast<int>(centre.x())).setTo(90);  // something occludes the left half
      const BoardDetection found = find_board(photo, board);
      ASSERT_TRUE(found.found()) << found.reason;
      score.add(found.view, truth);
    }
    EXPECT_GT(score.num_found, 0.2 * score.num_points);
    EXPECT_LT(score.num_found, 0.8 * score.num_points);
    EXPECT_LT(score.worst_px, 0.15);
  }
}

TEST(MarkerBoard, RefindsThePointsOfAKnownPose) {
  for (const Board& board : {charuco, aprilgrid}) {
    const BoardScene scene = scene_of(board, 2);
    PointScore score;
    for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
      const cv::Mat photo = render_board_photo(scene, i, {}, 1);
      const BoardView nothing{"a.png", {}};
      const BoardDetection found = refind_board(photo, board, nothing, scene.camera, scene.cam_from_board[i]);
      ASSERT_TRUE(found.found()) << found.reason;
      EXPECT_EQ(found.view.photo, "a.png");
      score.add(found.view, true_corners(scene, i));
    }
    EXPECT_GE(score.num_found, 0.98 * score.num_points);
    EXPECT_LT(score.worst_px, 0.1);
  }
}

/// The board as OpenCV draws it, from above; `legacy` has a white square at the top left.
cv::Mat opencv_charuco(bool legacy) {
  constexpr int square_px = 60;
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_100);
  cv::Mat photo;
  if (!legacy) {
    cv::aruco::CharucoBoard::create(9, 6, 0.03F, 0.022F, dictionary)->draw(cv::Size(9 * 60, 6 * 60), photo);
    return photo;
  }
  photo = cv::Mat(6 * square_px, 9 * square_px, CV_8U, cv::Scalar(255));
  int id = 0;
  for (int row = 0; row < 6; ++row) {
    for (int col = 0; col < 9; ++col) {
      cv::Mat square = photo(cv::Rect(col * square_px, row * square_px, square_px, square_px));
      cv::Mat marker;
      if ((row + col) % 2 == 1) {
        square.setTo(0);
      } else {
        cv::aruco::drawMarker(dictionary, id++, 44, marker);
        marker.copyTo(square(cv::Rect(8, 8, 44, 44)));
      }
    }
  }
  return photo;
}

TEST(MarkerBoard, ReadsBothOfOpenCvsCharucoLayouts) {
  for (const bool legacy : {false, true}) {
    cv::Mat photo;
    cv::copyMakeBorder(opencv_charuco(legacy), photo, 50, 50, 50, 50, cv::BORDER_CONSTANT, cv::Scalar(255));
    cv::GaussianBlur(photo, photo, cv::Size(), 0.7);  // no lens gives edges of one pixel
    const BoardDetection found = find_board(photo, charuco);
    ASSERT_TRUE(found.found()) << found.reason;
    EXPECT_EQ(found.view.corners.size(), 40u);
    for (const Corner& corner : found.view.corners) {
      const Eigen::Vector2d truth(50 + 60 * (1 + corner.index % 8) - 0.5, 50 + 60 * (1 + corner.index / 8) - 0.5);
      EXPECT_LT((corner.px - truth).norm(), 0.05) << corner.index;
    }
  }
}

TEST(MarkerBoard, SaysWhyThereIsNone) {
  const cv::Mat photo = render_board_photo(scene_of(charuco, 1), 0, {}, 1);
  const cv::Mat grey(480, 640, CV_8U, cv::Scalar(120));
  EXPECT_EQ(find_board(grey, charuco).reason, "no markers of DICT_5X5_100");
  EXPECT_EQ(find_board(grey, aprilgrid).reason, "no tags 36h11");
  EXPECT_EQ(find_board(photo, aprilgrid).reason, "no tags 36h11");
  Board narrower = charuco;
  narrower.cols = 5;
  EXPECT_THAT(find_board(photo, narrower).reason, ::testing::HasSubstr("lie as on the 5×5 board"));
  Board other = charuco;
  other.dictionary = "DICT_4X4_50";
  EXPECT_FALSE(find_board(photo, other).found());
  other.dictionary = "DICT_1X1_5";
  EXPECT_THAT(find_board(photo, other).reason, ::testing::HasSubstr("is not a marker dictionary"));
  EXPECT_FALSE(find_board(cv::Mat(), charuco).found());
}

}  // namespace
}  // namespace alidade
