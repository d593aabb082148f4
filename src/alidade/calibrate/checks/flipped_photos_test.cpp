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

/// A third of the photos, and half of them: which are right then only their number says.
TEST(FlippedPhotos, AreNamedWhereTheyAreMany) {
  struct Case {
    bool u, v;
    std::size_t every;
    const char* words;
  };
  for (const Case& flip :
       {Case{true, true, 3, "rotated by 180° they do"}, Case{true, true, 2, "rotated by 180° they do"},
        Case{true, false, 3, "mirrored left to right they do"}}) {
    constexpr std::uint64_t seed = 5;
    const Camera camera = testing::sample_camera("brown", {{"cx", 326.0}, {"cy", 232.0}});
    const BoardScene scene = testing::covered_scene(camera, 22, seed);
    std::vector<BoardView> views = testing::sample_views(scene, seed);
    for (std::size_t k = 0; k < views.size(); k += flip.every) views[k] = flipped(views[k], flip.u, flip.v);
    const Calibration result = testing::sample_calibration(views);
    ASSERT_EQ(result.status, CalibrateReport::Status::converged);
    const bool is_tie = flip.every == 2;
    for (std::size_t k = 0; k < views.size() && !is_tie; ++k) {
      EXPECT_EQ(result.views[k].used, k % flip.every != 0) << k;
      if (k % flip.every == 0) EXPECT_THAT(result.views[k].reason, ::testing::HasSubstr(flip.words));
    }
    EXPECT_EQ(result.verdict.state, State::care);
    EXPECT_THAT(result.verdict.sentence, ::testing::HasSubstr("against the others"));
    EXPECT_EQ(result.verdict.to_add, "take all photos as the camera stored them");
    for (const Eigen::Index at : {2, 3}) {  // cx, cy
      const double error = params(result.camera.lens)[at] - params(camera.lens)[at];
      if (!is_tie) EXPECT_LT(std::abs(error), 4.0 * std::sqrt(result.camera.cov(at, at)));
    }
  }
}

/// Corners without σ are kept as they are.
TEST(FlippedPhotos, ThatAreKeptAreNamed) {
  constexpr std::uint64_t seed = 5;
  const BoardScene scene = testing::covered_scene(camera_off_centre(), 20, seed);
  std::vector<BoardView> views = testing::sample_views(scene, seed, false);
  for (std::size_t k = 0; k < views.size(); k += 3) views[k] = flipped(views[k], true, true);
  const Calibration result = testing::sample_calibration(views, {.outliers = OutlierRule::keep});
  EXPECT_EQ(result.verdict.state, State::bad);
  EXPECT_EQ(result.verdict.exit_code, ExitCode::not_trusted);
  EXPECT_THAT(result.verdict.sentence, ::testing::HasSubstr("7 of 20 photos"));
  EXPECT_THAT(result.verdict.sentence, ::testing::HasSubstr("rotated by 180° against the others"));
}

/// A centre that differs in each photo is no orientation.
TEST(FlippedPhotos, AreNotSeenInACentreThatMoves) {
  constexpr std::uint64_t seed = 6;
  const BoardScene scene = testing::covered_scene(testing::sample_camera("brown"), 20, seed);
  std::vector<BoardView> views = testing::sample_views(scene, seed);
  for (std::size_t k = 0; k < views.size(); ++k)
    for (Corner& corner : views[k].corners) corner.px.x() += 8.0 * (static_cast<double>(7 * k % 20) / 9.5 - 1.0);
  const Calibration result = testing::sample_calibration(views);
  for (const ViewFit& view : result.views) EXPECT_TRUE(view.used) << view.reason;
}

/// A centre that jumps across the image's is a jump, or at least never good: only an exact mirror image is a flip.
TEST(FlippedPhotos, AreNotGoodWhereACentreJumps) {
  for (const double jump_px : {-9.0, -12.0, -14.0, -16.0}) {
    constexpr std::uint64_t seed = 1;
    const Camera camera = testing::sample_camera("brown", {{"cx", 324.3}});
    const BoardScene scene = testing::covered_scene(camera, 24, seed);
    std::vector<BoardView> views = testing::sample_views(scene, seed);
    for (std::size_t k = 19; k < views.size(); ++k)
      for (Corner& corner : views[k].corners) corner.px.x() += jump_px;
    EXPECT_NE(testing::sample_calibration(views).verdict.state, State::good) << jump_px;
  }
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
