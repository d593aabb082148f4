#include "alidade/calibrate/shape_transfer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/calibrate/checks/judge.h"
#include "alidade/testing/calibration_sample.h"

namespace alidade {
namespace {

using testing::sample_board;
using testing::sample_camera;
using testing::sample_scene;
using testing::sample_size;
using testing::sample_views;

std::vector<BoardView> bent_views(double bow_m, std::uint64_t seed, int num_photos = 16) {
  return sample_views(sample_scene(sample_camera("brown"), num_photos, seed, bow_m), seed);
}

ShapeTransfer transfer_of(BoardShape shape, double bow_m, std::uint64_t seed) {
  for (const ShapeTransfer& each : test_shape_transfer(sample_board, bent_views(bow_m, seed), sample_size, {})) {
    if (each.shape == shape) return each;
  }
  ADD_FAILURE() << "no test of " << shape_name(shape);
  return {};
}

TEST(ShapeTransfer, ABentBoardTransfers) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const ShapeTransfer transfer = transfer_of(BoardShape::free, 0.003, seed);
    EXPECT_TRUE(transfer.transfers());
    // Two coordinates of 0.1 px make 0.141 px a point. Of 8 · 108 coordinates, 155 go into the shape and 57 into lens
    // and poses: on unseen photos the shape's error adds 155/(864 − 155 − 57) = 0.24 of the noise's variance.
    EXPECT_LT(transfer.transfer_rms_px, std::sqrt(1.24) * 0.1 * std::sqrt(2.0)) << "seed " << seed;
  }
}

TEST(ShapeTransfer, ABoardWithNothingButNoiseDoesNot) {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u, 5u}) {
    const ShapeTransfer free = transfer_of(BoardShape::free, 0.0, seed);
    EXPECT_FALSE(free.transfers()) << "seed " << seed;
    EXPECT_GT(free.transfer_rms_px, free.flat_rms_px) << "what is learned from noise costs; seed " << seed;
    EXPECT_FALSE(transfer_of(BoardShape::bow, 0.0, seed).transfers()) << "seed " << seed;
  }
}

TEST(ShapeTransfer, TakesSixPhotos) {
  EXPECT_TRUE(test_shape_transfer(sample_board, bent_views(0.0, 1, 5), sample_size, {}).empty());
}

/// The larger of the errors of fx and fy in their σ by `cov`.
double focal_error_sigmas(const Camera& camera, const Eigen::MatrixXd& cov) {
  const Eigen::VectorXd off = params(camera.lens) - params(sample_camera("brown").lens);
  return std::max(std::abs(off[0]) / std::sqrt(cov(0, 0)), std::abs(off[1]) / std::sqrt(cov(1, 1)));
}

Calibration calibration_of(const std::vector<BoardView>& views, BoardShape shape) {
  CalibrateConfig config;
  config.board_shape = shape;
  PhotoCalibration photos;
  photos.views = views;
  photos.reasons.resize(views.size());
  photos.size = sample_size;
  photos.report = calibrate(sample_board, views, sample_size, config);
  return judge_calibration(sample_board, photos, config);
}

/// A bow of 0.5 mm on 200 mm hardly pays for a point each, yet with a flat board the focal length is off by many σ.
TEST(ShapeTransfer, ASmallBowIsNotMissed) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const auto views = bent_views(0.0005, seed);
    const Calibration flat = calibration_of(views, BoardShape::flat);
    const CalibrateReport& of_flat = flat;  // in the σ of single corners; the stated one counts some
    EXPECT_GT(focal_error_sigmas(of_flat.camera, of_flat.model_cov), 5.0) << "seed " << seed;
    EXPECT_NE(flat.verdict.state, State::good) << flat.verdict.sentence;
    EXPECT_EQ(flat.verdict.to_add, "use --board-shape bow");
    for (const BoardShape asked : {BoardShape::automatic, BoardShape::bow, BoardShape::free}) {
      const Calibration result = calibration_of(views, asked);
      EXPECT_NE(result.config.board_shape, BoardShape::flat) << "seed " << seed;
      EXPECT_EQ(result.asked_shape, asked);
      const Camera& camera = result.camera;
      EXPECT_LT(focal_error_sigmas(camera, camera.cov), 4.0) << "seed " << seed << ", " << shape_name(asked);
    }
  }
}

ShapeTransfer given(BoardShape shape, double transfer_rms_px, double gain_sigmas) {
  return {shape, 1.0, transfer_rms_px, gain_sigmas};
}

TEST(DecideShape, TakesWhatPredictsBest) {
  using S = BoardShape;
  const auto good_free = given(S::free, 0.5, 9.0), fair_free = given(S::free, 0.93, 9.0),
             no_free = given(S::free, 1.1, -5.0);
  const auto good_bow = given(S::bow, 0.7, 9.0), small_bow = given(S::bow, 0.98, 3.0),
             no_bow = given(S::bow, 0.999, 1.0);
  const auto decided = [](S asked, const ShapeTransfer& bow, const ShapeTransfer& free) {
    return decide_shape(asked, std::vector{bow, free});
  };
  EXPECT_EQ(decided(S::automatic, good_bow, good_free), S::free);
  EXPECT_EQ(decided(S::automatic, good_bow, fair_free), S::bow);
  EXPECT_EQ(decided(S::automatic, no_bow, fair_free), S::flat) << "a clear tenth is asked of every point";
  EXPECT_EQ(decided(S::automatic, small_bow, no_free), S::bow);
  EXPECT_EQ(decided(S::automatic, no_bow, no_free), S::flat);
  EXPECT_EQ(decided(S::free, good_bow, fair_free), S::free) << "as asked";
  EXPECT_EQ(decided(S::free, good_bow, no_free), S::bow);
  EXPECT_EQ(decided(S::free, no_bow, no_free), S::flat);
  EXPECT_EQ(decided(S::bow, small_bow, good_free), S::bow) << "as asked";
  EXPECT_EQ(decided(S::bow, no_bow, good_free), S::flat);
  EXPECT_EQ(decided(S::flat, good_bow, good_free), S::flat) << "as asked";
  EXPECT_EQ(decide_shape(S::free, {}), S::free) << "nothing speaks against it";
  EXPECT_EQ(decide_shape(S::automatic, {}), S::flat);
}

}  // namespace
}  // namespace alidade
