#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "alidade/testing/calibration_sample.h"

// One photo among others whose image was mirrored, or rotated by half a turn.

namespace alidade {
namespace {

/// Its centre is beside the image's: about it nothing tells.
Camera camera_off_centre() { return testing::sample_camera("brown", {{"cx", 338.0}, {"cy", 222.0}}); }

/// As corners are found in such an image: numbered as seen from the front.
BoardView flipped(BoardView view, bool u, bool v) {
  const ImageSize size = testing::sample_size;
  const int cols = testing::sample_board.cols;
  for (Corner& corner : view.corners) {
    if (u) corner.px.x() = size.width_px - 1.0 - corner.px.x();
    if (v) corner.px.y() = size.height_px - 1.0 - corner.px.y();
    if (u != v) corner.index = corner.index / cols * cols + cols - 1 - corner.index % cols;
  }
  return view;
}

TEST(FlippedPhotos, AreNamed) {
  struct Case {
    bool u, v;
    const char* words;
  };
  for (const Case& flip :
       {Case{true, false, "mirrored left to right they do"}, Case{false, true, "mirrored upside down they do"},
        Case{true, true, "rotated by 180° they do"}}) {
    constexpr std::uint64_t seed = 3;
    const BoardScene scene = testing::covered_scene(camera_off_centre(), 14, seed);
    std::vector<BoardView> views = testing::sample_views(scene, seed);
    views[4] = flipped(views[4], flip.u, flip.v);
    const Calibration result = testing::sample_calibration(views);
    ASSERT_EQ(result.status, CalibrateReport::Status::converged);
    ASSERT_FALSE(result.views[4].used) << flip.words;
    EXPECT_THAT(result.views[4].reason, ::testing::HasSubstr(flip.words));
    ASSERT_EQ(result.counts.skipped.size(), 1u);
    EXPECT_THAT(result.counts.skipped[0].reason, ::testing::HasSubstr("take the photo as the camera stored it"));
  }
}

TEST(FlippedPhotos, AreNamedOfABoardThatIsGiven) {
  constexpr std::uint64_t seed = 3;
  const BoardScene scene = testing::covered_scene(camera_off_centre(), 14, seed);
  std::vector<BoardView> views = testing::sample_views(scene, seed);
  views[4] = flipped(views[4], true, false);
  CalibrateConfig config;
  config.board_shape = BoardShape::given;
  config.board_points = points_in_board(testing::sample_board);
  const Calibration result = testing::sample_calibration(views, config);
  ASSERT_EQ(result.status, CalibrateReport::Status::converged);
  EXPECT_THAT(result.views[4].reason, ::testing::HasSubstr("mirrored left to right they do"));
}

/// Corners that are wrong for another reason are no flipped image's.
TEST(FlippedPhotos, AreNotSeenInCornersOfAnotherBoard) {
  constexpr std::uint64_t seed = 3;
  const BoardScene scene = testing::covered_scene(camera_off_centre(), 14, seed);
  std::vector<BoardView> views = testing::sample_views(scene, seed);
  for (Corner& corner : views[4].corners) corner.px.x() *= 0.8;
  const Calibration result = testing::sample_calibration(views);
  ASSERT_FALSE(result.views[4].used);
  EXPECT_THAT(result.views[4].reason, ::testing::EndsWith("do not fit the other photos"));
}

}  // namespace
}  // namespace alidade
