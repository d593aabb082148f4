#include "alidade/board_detector/find_board.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <ctime>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/simulate/boards/board_photos.h"

namespace alidade {
namespace {

constexpr std::size_t photos_per_condition = 3;

Camera camera_of(int width_px, int height_px, double f_px, double k1) {
  Camera camera{.width_px = width_px, .height_px = height_px, .lens = {}, .cov = {}, .rms_px = 0.0, .source = {}};
  Calibrated<Brown> lens;
  lens.params << f_px, f_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1), 0.0, k1, 0.0, 0.0, 0.0, 0.0;
  camera.lens = lens;
  return camera;
}

Board chessboard(int cols, int rows) {
  return {.kind = BoardKind::chessboard, .cols = cols, .rows = rows, .square_m = 0.03};
}

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct PhotoCondition {
  const char* name;
  double blur_px, noise, max_tilt_rad, k1;
  double goal_px;  ///< RMS a coordinate.
};

struct Accuracy {
  double rms_px = 0.0, chi2_per_dof = 0.0;
  std::size_t corners = 0;
};

/// Errors of all corners of some rendered boards whose squares are 28–44 px. `again`: by refind_board.
Accuracy accuracy_of(const PhotoCondition& condition, bool again) {
  const Camera camera = camera_of(800, 600, 800.0, condition.k1);
  const Board board = chessboard(10, 9);  // not symmetric: numbers are unique
  const BoardScene scene = draw_board_scene(camera, board,
                                            {.num_photos = static_cast<int>(photos_per_condition),
                                             .max_tilt_rad = condition.max_tilt_rad,
                                             .min_fill = 0.33,
                                             .max_fill = 0.5},
                                            7);
  Accuracy accuracy;
  double sum = 0.0, chi2 = 0.0;
  for (std::size_t i = 0; i < photos_per_condition; ++i) {
    const cv::Mat photo =
        render_board_photo(scene, i, {.blur_px = condition.blur_px, .noise = condition.noise}, 100 + i);
    BoardDetection found = find_board(photo, board);
    if (again) found = refind_board(photo, board, found.view, camera, scene.cam_from_board[i]);
    const auto truth = true_corners(scene, i);
    for (const Corner& corner : found.view.corners) {
      const Eigen::Vector2d error = corner.px - truth[static_cast<std::size_t>(corner.index)];
      sum += error.squaredNorm();
      chi2 += error.dot(corner.cov.inverse() * error);
      ++accuracy.corners;
    }
  }
  const auto coordinates = 2.0 * static_cast<double>(accuracy.corners);
  accuracy.rms_px = std::sqrt(sum / coordinates);
  accuracy.chi2_per_dof = chi2 / coordinates;
  return accuracy;
}

class Corners : public ::testing::TestWithParam<PhotoCondition> {};

TEST_P(Corners, ReachTheGoalWithTheErrorTheyState) {
  const PhotoCondition& condition = GetParam();
  for (const bool again : {false, true}) {
    const Accuracy accuracy = accuracy_of(condition, again);
    EXPECT_EQ(accuracy.corners, photos_per_condition * 90) << "found again: " << again;
    EXPECT_LE(accuracy.rms_px, condition.goal_px) << "found again: " << again;
    // σ within 25 % of the scatter.
    EXPECT_GT(accuracy.chi2_per_dof, 1.0 / (1.25 * 1.25)) << "found again: " << again;
    EXPECT_LT(accuracy.chi2_per_dof, 1.25 * 1.25) << "found again: " << again;
  }
}

INSTANTIATE_TEST_SUITE_P(Rendered, Corners,
                         ::testing::Values(PhotoCondition{"sharp", 0.6, 2.0, 0.5, 0.0, 0.009},
                                           PhotoCondition{"noisy", 0.6, 6.0, 0.5, 0.0, 0.014},
                                           PhotoCondition{"blurred", 1.5, 2.0, 0.5, 0.0, 0.009},
                                           PhotoCondition{"tilted", 0.6, 2.0, 1.05, 0.0, 0.008},
                                           PhotoCondition{"distorted", 0.6, 2.0, 0.5, -0.3, 0.009}),
                         [](const auto& instance) { return instance.param.name; });

class RenderedBoard : public ::testing::Test {
 protected:
  void SetUp() override {
    scene = draw_board_scene(camera_of(640, 480, 600.0, -0.2), board, {.num_photos = 1, .max_fill = 0.6}, 5);
    photo = render_board_photo(scene, 0, {}, 11);
  }

  /// Every corner is within a tenth of a pixel of where `place` puts the true one.
  template <class Place>
  void expect_whole(const BoardDetection& detection, const Place& place) const {
    ASSERT_TRUE(detection.found()) << detection.reason;
    ASSERT_EQ(detection.view.corners.size(), 54u);
    const auto truth = true_corners(scene, 0);
    for (const Corner& corner : detection.view.corners) {
      EXPECT_LT((corner.px - place(truth[static_cast<std::size_t>(corner.index)])).norm(), 0.1) << corner.index;
    }
  }

  static Eigen::Vector2d same(const Eigen::Vector2d& px) { return px; }

  Board board = chessboard(9, 6);
  BoardScene scene;
  cv::Mat photo;
};

TEST_F(RenderedBoard, IsFoundInImagesOfEveryType) {
  cv::Mat colour, with_alpha, deep, floating;
  cv::cvtColor(photo, colour, cv::COLOR_GRAY2BGR);
  cv::cvtColor(photo, with_alpha, cv::COLOR_GRAY2BGRA);
  photo.convertTo(deep, CV_16U, 16.0);  // 12 bits in 16
  photo.convertTo(floating, CV_32F, 1.0 / 255.0);
  for (const cv::Mat& image : {photo, colour, with_alpha, deep, floating}) {
    expect_whole(find_board(image, board), same);
  }
}

TEST_F(RenderedBoard, KeepsItsNumbersUpsideDown) {
  cv::Mat turned;
  cv::rotate(photo, turned, cv::ROTATE_180);
  expect_whole(find_board(turned, board), [&](const Eigen::Vector2d& px) {
    return Eigen::Vector2d(photo.cols - 1 - px.x(), photo.rows - 1 - px.y());
  });
  cv::rotate(photo, turned, cv::ROTATE_90_CLOCKWISE);
  expect_whole(find_board(turned, board),
               [&](const Eigen::Vector2d& px) { return Eigen::Vector2d(photo.rows - 1 - px.y(), px.x()); });
}

TEST_F(RenderedBoard, IsFoundSmallLargeAndFaint) {
  cv::Mat small, large, faint;
  cv::resize(photo, small, {}, 0.4, 0.4, cv::INTER_AREA);
  expect_whole(find_board(small, board),
               [](const Eigen::Vector2d& px) { return Eigen::Vector2d((px.array() + 0.5) * 0.4 - 0.5); });
  cv::resize(photo, large, {}, 4.0, 4.0, cv::INTER_CUBIC);
  const BoardDetection found = find_board(large, board);
  EXPECT_EQ(found.view.corners.size(), 54u) << found.reason;
  photo.convertTo(faint, CV_8U, 0.12, 30.0);
  EXPECT_EQ(find_board(faint, board).view.corners.size(), 54u);
}

TEST_F(RenderedBoard, OfAnotherSizeIsRefusedByName) {
  EXPECT_EQ(find_board(photo, chessboard(8, 6)).reason, "a grid of 9×6 corners, not 8×6");
  EXPECT_EQ(find_board(photo, chessboard(10, 7)).reason, "a grid of 9×6 corners, not 10×7");
}

TEST_F(RenderedBoard, PartlyCoveredGivesTheCornersThatAreSeen) {
  const auto truth = true_corners(scene, 0);
  cv::Mat covered = photo.clone();
  cv::circle(covered, {static_cast<int>(truth[22].x()), static_cast<int>(truth[22].y())}, 12, cv::Scalar(200), -1);
  const BoardDetection found = find_board(covered, board);
  ASSERT_TRUE(found.found()) << found.reason;
  EXPECT_LT(found.view.corners.size(), 54u);
  EXPECT_GE(found.view.corners.size(), 45u);  // the covered one and its eight neighbours at most
  for (const Corner& corner : found.view.corners) {
    EXPECT_LT((corner.px - truth[static_cast<std::size_t>(corner.index)]).norm(), 0.3) << corner.index;
  }
  EXPECT_EQ(find_board(covered, board, true).reason,
            "only " + std::to_string(found.view.corners.size()) + " of 54 corners");
}

TEST(FindBoard, PlacesABoardCutByTheImageByTheBordersThatAreSeen) {
  const Board board = chessboard(9, 6);
  const Rigid3 cam_from_board{Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitZ())),
                              {-0.15, -0.1, 0.6}};
  const BoardScene scene{.camera = camera_of(640, 480, 600.0, 0.0),
                         .board = board,
                         .points_in_board = points_in_board(board),
                         .cam_from_board = {cam_from_board}};
  const cv::Mat photo = render_board_photo(scene, 0, {}, 1);
  const auto truth = true_corners(scene, 0);
  const int cut_px = static_cast<int>(0.5 * (truth[7].x() + truth[8].x()));  // the last column is outside
  const BoardDetection found = find_board(photo.colRange(0, cut_px), board);
  ASSERT_TRUE(found.found()) << found.reason;
  EXPECT_GE(found.view.corners.size(), 46u);
  for (const Corner& corner : found.view.corners) {
    EXPECT_LT((corner.px - truth[static_cast<std::size_t>(corner.index)]).norm(), 0.1) << corner.index;
  }
  // Without any border in the image the part is ambiguous.
  const cv::Rect centre(static_cast<int>(truth[0].x()) - 14, static_cast<int>(truth[0].y()) - 14, 200, 120);
  EXPECT_NE(find_board(photo(centre), board).reason.find("cannot be determined which"), std::string::npos);
}

TEST(FindBoard, SaysWhyThereIsNoBoard) {
  const Board board;
  EXPECT_EQ(find_board(cv::Mat(), board).reason, "there is no image");
  EXPECT_EQ(find_board(cv::Mat::zeros(1, 1, CV_8U), board).reason, "the image is too small: 1×1");
  EXPECT_EQ(find_board(cv::Mat::zeros(480, 640, CV_16U), board).reason, "the image is black");
  EXPECT_EQ(find_board(cv::Mat::zeros(480, 640, CV_8UC3), board).reason, "no chessboard corners");
  cv::Mat stripes(480, 640, CV_8U);
  for (int x = 0; x < stripes.cols; ++x) stripes.col(x).setTo(x / 16 % 2 == 0 ? 30 : 220);
  EXPECT_FALSE(find_board(stripes, board).found());
}

TEST(FindBoard, FindsNothingInTexturesAndSoonSaysSo) {
  cv::RNG random(1);
  for (const double grain_px : {0.0, 1.0, 2.0, 4.0}) {
    cv::Mat texture(960, 1280, CV_32F);
    random.fill(texture, cv::RNG::NORMAL, 0.0, 1.0);
    if (grain_px > 0.0) cv::GaussianBlur(texture, texture, {}, grain_px);
    cv::normalize(texture, texture, 0.0, 255.0, cv::NORM_MINMAX);
    texture.convertTo(texture, CV_8U);
    const double start = processor_seconds();
    EXPECT_FALSE(find_board(texture, Board{}).found());
    EXPECT_LT(processor_seconds() - start, 1.5);  // 0.05–0.1 s here; sanitizers take ten times as long
  }
}

}  // namespace
}  // namespace alidade
