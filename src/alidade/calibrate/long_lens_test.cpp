#include <gtest/gtest.h>

#include <cmath>

#include "alidade/testing/calibration_sample.h"

namespace alidade {
namespace {

/// A long lens, a board far away, few photos: the weakest direction is far weaker than the others, and curved.
TEST(LongLens, IsCalibratedFromSevenPhotos) {
  const Camera camera = testing::sample_camera(
      "brown", {{"fx", 1600.0}, {"fy", 1600.0}, {"k1", -0.15}, {"k2", 0.0}, {"k3", 0.0}, {"p1", 0.0}, {"p2", 0.0}});
  BoardSceneConfig far;
  far.num_photos = 7;
  far.min_fill = 0.25;
  far.max_fill = 0.35;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const BoardScene scene = draw_board_scene(camera, testing::sample_board, far, seed);
    const CalibrateReport report = calibrate(testing::sample_board, simulate_views(scene, 0.05, seed),
                                             testing::sample_size, {.fixed = {"skew", "k3"}});
    ASSERT_EQ(report.status, CalibrateReport::Status::converged) << "seed " << seed << ": " << report.reason;
    for (const int at : {0, 1, 2, 3}) {
      const double error = params(report.camera.lens)[at] - params(camera.lens)[at];
      EXPECT_LT(std::abs(error), 5.0 * std::sqrt(report.camera.cov(at, at))) << "seed " << seed << ", " << at;
    }
  }
}

}  // namespace
}  // namespace alidade
