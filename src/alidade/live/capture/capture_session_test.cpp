// What is said of a stream that is no good, and what stands on disk. Times are given: no clock.
#include "alidade/live/capture/capture_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <opencv2/core.hpp>

#include "alidade/files/files.h"
#include "alidade/simulate/boards/board_photos.h"

namespace alidade::live {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const Board nine_by_six{.cols = 9, .rows = 6, .square_m = 0.025};

class Session : public ::testing::Test {
 protected:
  void SetUp() override { fs::remove_all(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  CaptureSession begun(const CaptureConfig& config = {}) {
    return {nine_by_six, config, KeptPhotos(folder_, false),
            [this](const std::string& line) { said_.push_back(line); }};
  }
  /// Photo `at` of a camera of that focal length.
  static cv::Mat photo(const Board& board, std::size_t at, double focal_px = 600.0) {
    Calibrated<Brown> lens;
    lens.params << 600, 600, 320, 240, 0, -0.2, 0.05, 0, 0, 0;
    Camera camera{.width_px = 640, .height_px = 480, .lens = lens, .cov = {}, .source = ""};
    BoardScene scene = draw_board_scene(camera, board, {.num_photos = 12, .max_fill = 0.7}, 5);
    lens.params.head<2>().setConstant(focal_px);
    scene.camera.lens = lens;
    return render_board_photo(scene, at, {}, 5);
  }
  /// Never twice the same bits.
  static cv::Mat empty(int i) {
    cv::Mat grey(480, 640, CV_8U, cv::Scalar(120));
    grey.at<uchar>(i % 480, i / 480) = 200;
    return grey;
  }

  const fs::path folder_ = fs::temp_directory_path() / ("alidade-session-" + std::to_string(::getpid()));
  std::vector<std::string> said_;
};

TEST_F(Session, SaysAfterAMinuteWithoutABoardWhichOneIsLookedFor) {
  CaptureSession session = begun();
  for (int i = 0; i < 12; ++i) (void)session.see(empty(i), 5.0 * i, true);
  EXPECT_THAT(said_, ElementsAre());
  for (int i = 12; i < 30; ++i) (void)session.see(empty(i), 5.0 * i, true);
  EXPECT_THAT(said_, ElementsAre("no board for a minute; what is looked for: a chessboard of 9×6 inner corners"));
}

TEST_F(Session, NamesAnotherBoardOnceAfterThreeImages) {
  CaptureSession session = begun();
  const cv::Mat other = photo({.cols = 7, .rows = 6, .square_m = 0.025}, 0);
  for (int i = 0; i < 6; ++i) {
    cv::Mat grey = other.clone();
    grey.at<uchar>(0, i) = 77;
    EXPECT_EQ(session.see(grey, 0.1 * i, true).look.status, LookStatus::other_board);
    EXPECT_EQ(said_.size(), i < 2 ? 0u : 1u) << i;
  }
  EXPECT_THAT(said_.front(), HasSubstr("a board of 7×6 corners is in view, not of 9×6"));
}

TEST_F(Session, NamesAFrozenStreamAfterFiveSeconds) {
  CaptureSession session = begun();
  const cv::Mat grey = photo(nine_by_six, 0);
  for (int i = 0; i < 10; ++i) (void)session.see(grey, 0.5 * i, true);
  EXPECT_THAT(said_, ElementsAre());
  for (int i = 10; i < 14; ++i) (void)session.see(grey, 0.5 * i, true);
  EXPECT_THAT(said_, ElementsAre(HasSubstr("the stream is frozen")));
}

TEST_F(Session, NamesAnAutofocusThatMovesTheFocalLengthOfRenderedPhotos) {
  for (const double walk : {0.0, 0.015}) {
    TearDown();
    said_.clear();
    CaptureSession session = begun({.until_px = 0.01, .is_video = false});
    for (std::size_t i = 0; i < 12; ++i) {
      const double focal_px = 600.0 * (1.0 + walk * static_cast<double>(i % 4) / 3.0);
      EXPECT_EQ(session.take(photo(nine_by_six, i, focal_px), static_cast<double>(i), true), "") << i;
    }
    if (walk > 0.0) {
      EXPECT_THAT(said_, ElementsAre(HasSubstr("switch the camera's autofocus off")));
    } else {
      EXPECT_THAT(said_, ElementsAre());
    }
  }
}

TEST_F(Session, APausedOneTakesByHandAlone) {
  CaptureSession session = begun({.is_video = false});
  session.pause(true);
  const cv::Mat grey = photo(nine_by_six, 0);
  EXPECT_EQ(session.see(grey, 0.0, true).file, "");
  EXPECT_TRUE(session.kept().photos().empty());
  EXPECT_EQ(session.take(grey, 0.1, true), "");
  ASSERT_EQ(session.kept().photos().size(), 1u);
  EXPECT_TRUE(fs::exists(folder_ / "photos" / "000001.png"));
  EXPECT_EQ(read_file(folder_ / "photos.csv"), "file,t_s,exact\n000001.png,0.100000,1\n");
  EXPECT_TRUE(session.undo());
  EXPECT_FALSE(fs::exists(folder_ / "photos" / "000001.png"));
  session.pause(false);
  EXPECT_EQ(session.see(photo(nine_by_six, 1), 1.0, true).file, "000002.png");
}

}  // namespace
}  // namespace alidade::live
