#include "alidade/calibrate/calibrate_photos.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/geometry/decompositions.h"
#include "alidade/testing/calibration_sample.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using testing::sample_board;

constexpr int num_photos = 8;

/// Eight rendered photos, once for all tests.
struct Photos {
  BoardScene scene = testing::sample_scene(testing::sample_camera("brown"), num_photos, 3);
  std::vector<std::string> names;
  std::vector<cv::Mat> images;

  Photos() {
    for (std::size_t i = 0; i < num_photos; ++i) {
      names.push_back(photo_name(i));
      images.push_back(render_board_photo(scene, i, {}, 5));
    }
  }
  [[nodiscard]] PhotoLoader loader() const {
    return [this](std::size_t i) { return images[i]; };
  }
};

const Photos& photos() {
  static const Photos made;
  return made;
}

TEST(CalibratePhotos, IsAsWrongAsItSaysFromPixelsToCamera) {
  const auto result = calibrate_photos(photos().names, photos().loader(), sample_board, {});
  ASSERT_EQ(result.report.status, CalibrateReport::Status::converged) << result.report.reason;
  EXPECT_EQ(result.num_unreadable, 0u);
  for (std::size_t i = 0; i < num_photos; ++i) {
    EXPECT_TRUE(result.report.views[i].used) << result.report.views[i].reason;
    EXPECT_EQ(result.views[i].corners.size(), 54u);
  }
  const Camera& found = result.report.camera;
  Eigen::VectorXd error(9);
  Eigen::MatrixXd cov(9, 9);
  const std::vector<int> free = {0, 1, 2, 3, 5, 6, 7, 8, 9};
  for (int i = 0; i < 9; ++i) {
    const int at = free[static_cast<std::size_t>(i)];
    error[i] = params(found.lens)[at] - params(photos().scene.camera.lens)[at];
    for (int j = 0; j < 9; ++j) cov(i, j) = found.cov(at, free[static_cast<std::size_t>(j)]);
  }
  EXPECT_LT(squared_mahalanobis(error, cov), 42.7);  // χ²(9) beyond it with probability < 3·10⁻⁶
}

TEST(CalibratePhotos, AWrongBoardGivesNoCamera) {
  int refused = 0;
  for (const auto& [cols, rows] : {std::pair{8, 6}, std::pair{9, 5}, std::pair{7, 5}, std::pair{10, 7}}) {
    Board wrong = sample_board;
    wrong.cols = cols;
    wrong.rows = rows;
    const auto result = calibrate_photos(photos().names, photos().loader(), wrong, {});
    EXPECT_EQ(result.report.status, CalibrateReport::Status::degenerate) << cols << "x" << rows;
    EXPECT_FALSE(result.report.to_add.empty());
    ++refused;
  }
  EXPECT_EQ(refused, 4);
}

TEST(CalibratePhotos, APhotoOfAnotherSizeIsNamed) {
  Photos changed = photos();
  const cv::Rect part(0, 0, 640, 470);
  changed.images[4] = changed.images[4](part).clone();
  const auto result = calibrate_photos(changed.names, changed.loader(), sample_board, {});
  ASSERT_EQ(result.report.status, CalibrateReport::Status::converged);
  EXPECT_FALSE(result.report.views[4].used);
  EXPECT_EQ(result.report.views[4].reason, "is 640x470, but most photos are 640x480");
  EXPECT_EQ(result.reasons[4], result.report.views[4].reason);
  EXPECT_EQ(result.size.height_px, 480);
}

TEST(CalibratePhotos, PhotosWithoutABoardAndUnreadableOnesAreNamed) {
  Photos changed = photos();
  changed.images[2] = cv::Mat(480, 640, CV_8UC1, cv::Scalar(90));
  const PhotoLoader loader = [&changed](std::size_t i) {
    if (i == 5) throw std::runtime_error("the image is cut off");
    return changed.images[i];
  };
  const auto result = calibrate_photos(changed.names, loader, sample_board, {});
  ASSERT_EQ(result.report.status, CalibrateReport::Status::converged);
  EXPECT_FALSE(result.report.views[2].used);
  EXPECT_FALSE(result.report.views[2].reason.empty());
  EXPECT_NE(result.report.views[2].reason, "no corners") << "say what the search found";
  EXPECT_EQ(result.report.views[5].reason, "the image is cut off");
  EXPECT_EQ(result.num_unreadable, 1u);
}

TEST(CalibratePhotos, TheSizeThatMostPhotosHaveDecidesNotTheFirst) {
  Photos changed = photos();
  cv::resize(changed.images[0], changed.images[0], {800, 600});
  cv::rotate(changed.images[3], changed.images[3], cv::ROTATE_90_CLOCKWISE);
  const auto result = calibrate_photos(changed.names, changed.loader(), sample_board, {});
  ASSERT_EQ(result.report.status, CalibrateReport::Status::converged) << result.report.reason;
  EXPECT_EQ(result.size.width_px, 640);
  EXPECT_EQ(result.size.height_px, 480);
  EXPECT_EQ(result.report.views[0].reason, "is 800x600, but most photos are 640x480");
  EXPECT_THAT(result.report.views[3].reason,
              HasSubstr("is 480x640, but most photos are 640x480: its pixels were turned"));
  EXPECT_TRUE(result.report.views[1].used);
}

TEST(CalibratePhotos, ABoardGivenInSquaresIsNamedInInnerCorners) {
  Board squares = sample_board;
  squares.cols += 1;
  squares.rows += 1;
  const auto result = calibrate_photos(photos().names, photos().loader(), squares, {});
  EXPECT_EQ(result.report.status, CalibrateReport::Status::degenerate);
  EXPECT_EQ(result.report.reason, "the photos do not show the board as given, 10×7");
  EXPECT_EQ(result.report.to_add, "use --board 9x6: they show that board");
}

TEST(CalibratePhotos, NoPhotoAtAllIsARefusal) {
  const auto none = calibrate_photos({}, photos().loader(), sample_board, {});
  EXPECT_EQ(none.report.status, CalibrateReport::Status::degenerate);
  const PhotoLoader broken = [](std::size_t) -> cv::Mat { throw std::runtime_error("not an image"); };
  const auto unread = calibrate_photos(photos().names, broken, sample_board, {});
  EXPECT_EQ(unread.report.status, CalibrateReport::Status::degenerate);
  EXPECT_EQ(unread.num_unreadable, static_cast<std::size_t>(num_photos));
  EXPECT_EQ(unread.size.width_px, 0);
}

TEST(CalibratePhotos, StopsWhenAsked) {
  for (const std::string stage : {"looking for the board", "extracting the corners again"}) {
    const Progress stop = [&](std::string_view what, std::size_t done, std::size_t) {
      return what != stage || done < 2;
    };
    EXPECT_THROW((void)calibrate_photos(photos().names, photos().loader(), sample_board, {}, {}, stop), Interrupted)
        << stage;
  }
}

}  // namespace
}  // namespace alidade
