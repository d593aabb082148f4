#include "alidade/imaging/find_board.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "alidade/simulate/board_photos.h"

namespace alidade {
namespace {

Camera vga_camera() {
  Camera camera{.width_px = 640, .height_px = 480, .lens = {}, .cov = {}, .rms_px = 0.0, .source = {}};
  Calibrated<Brown> lens;
  lens.params << 600.0, 602.0, 318.0, 242.0, 0.0, -0.25, 0.1, 0.0005, -0.0005, 0.0;
  camera.lens = lens;
  return camera;
}

TEST(FindBoard, FindsEveryCornerOfRenderedChessboardsInItsPlace) {
  const Board board{.kind = BoardKind::chessboard, .cols = 9, .rows = 6, .square_m = 0.03};
  const BoardScene scene = draw_board_scene(vga_camera(), board, {.num_photos = 6}, 5);
  for (std::size_t i = 0; i < scene.cam_from_board.size(); ++i) {
    const BoardDetection detection = find_board(render_board_photo(scene, i, {}, 11 + i), board);
    ASSERT_TRUE(detection.found()) << detection.reason;
    ASSERT_EQ(detection.view.corners.size(), 54u);
    const auto truth = true_corners(scene, i);
    for (const Corner& corner : detection.view.corners) {
      const auto index = static_cast<std::size_t>(corner.index);
      EXPECT_LT((corner.px - truth[index]).norm(), 0.1) << "photo " << i << ", corner " << index;
    }
  }
}

TEST(FindBoard, SaysWhyThereIsNoBoard) {
  const Board board;
  EXPECT_EQ(find_board(cv::Mat(), board).reason, "there is no picture");
  EXPECT_EQ(find_board(cv::Mat::zeros(1, 1, CV_8U), board).reason, "the picture is too small: 1×1");
  EXPECT_FALSE(find_board(cv::Mat::zeros(480, 640, CV_8UC3), board).found());
}

}  // namespace
}  // namespace alidade
