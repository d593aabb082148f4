#include "alidade/calibrate/checks/residual_structure.h"

#include <gtest/gtest.h>

#include <numeric>

#include "alidade/testing/calibration_sample.h"

namespace alidade {
namespace {

using testing::sample_board;
using testing::sample_size;

struct Solved {
  std::vector<BoardView> views;
  CalibrateReport report;
};

Solved solve(std::uint64_t seed) {
  Solved solved{testing::sample_views(testing::sample_scene(testing::sample_camera("brown"), 12, seed), seed), {}};
  solved.views[3].corners[20].px.x() += 5.0;  // rejected, so that "used" matters
  solved.report = calibrate(sample_board, solved.views, sample_size, {});
  return solved;
}

TEST(ResidualCells, HoldEveryUsedCornerOnce) {
  const auto [views, report] = solve(1);
  ASSERT_EQ(report.corners_dropped, 1);
  int corners = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero(), truth = Eigen::Vector2d::Zero();
  for (const ResidualCell& cell : residual_cells(views, report, 8, 6)) {
    corners += cell.count;
    sum += cell.count * cell.mean_px;
  }
  for (const ViewFit& view : report.views) {
    for (const CornerResidual& fit : view.corners) truth += fit.used ? fit.residual_px : Eigen::Vector2d::Zero();
  }
  EXPECT_EQ(corners, report.corners_used);
  EXPECT_EQ(corners, 12 * 54 - 1);
  EXPECT_LT((sum - truth).norm(), 1e-9);  // rounding
}

TEST(ResidualCells, AreNoiseWhereTheModelFits) {
  int cells = 0, beyond = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const auto [views, report] = solve(seed);
    for (const ResidualCell& cell : residual_cells(views, report, 8, 6)) {
      if (cell.count == 0) continue;
      ++cells;
      beyond += cell.z > 3.0;
    }
  }
  // z² is χ²(2): beyond 3 with probability exp(−4.5) = 0.0111, less what the fit takes up. Four σ of that count.
  EXPECT_GT(cells, 300);
  EXPECT_LT(beyond, 0.0111 * cells + 4 * std::sqrt(0.0111 * cells));
}

TEST(ResidualCells, ShowWhatPullsOneCornerOfTheImage) {
  auto [views, report] = solve(2);
  for (std::size_t k = 0; k < views.size(); ++k) {
    for (std::size_t i = 0; i < views[k].corners.size(); ++i) {
      const Eigen::Vector2d& px = views[k].corners[i].px;
      const bool in_first_cell = px.x() < 319.5 && px.y() < 239.5;
      report.views[k].corners[i].residual_px = in_first_cell ? Eigen::Vector2d(0.1, 0.0) : Eigen::Vector2d(0.0, 0.0);
    }
  }
  const auto cells = residual_cells(views, report, 2, 2);
  EXPECT_NEAR(cells[0].mean_px.x(), 0.1, 1e-12);
  EXPECT_NEAR(cells[0].z, 0.1 * std::sqrt(cells[0].count) / shared_noise_px(report), 1e-9);
  for (const std::size_t other : {1u, 2u, 3u}) EXPECT_EQ(cells[other].z, 0.0);
  EXPECT_NEAR(cells[0].u_px, 159.5, 1e-12);  // 320 pixels, the first centred on 0
  EXPECT_NEAR(cells[3].v_px, 359.5, 1e-12);
}

TEST(ResidualRings, TellRadialFromTangential) {
  auto [views, report] = solve(3);
  const Eigen::Vector2d centre = params(report.camera.lens).segment<2>(2);
  for (std::size_t k = 0; k < views.size(); ++k) {
    for (std::size_t i = 0; i < views[k].corners.size(); ++i) {
      const Eigen::Vector2d out = (views[k].corners[i].px - centre).normalized();
      const Eigen::Vector2d around(-out.y(), out.x());  // from x to y: clockwise on the screen
      report.views[k].corners[i].residual_px = 0.2 * out - 0.05 * around;
    }
  }
  int corners = 0;
  for (const ResidualRing& ring : residual_rings(views, report, 10)) {
    corners += ring.count;
    if (ring.count == 0) continue;
    EXPECT_NEAR(ring.mean_radial_px, 0.2, 1e-12);
    EXPECT_NEAR(ring.mean_tangential_px, -0.05, 1e-12);
    EXPECT_NEAR(ring.sigma_px, shared_noise_px(report) / std::sqrt(ring.count), 1e-12);
  }
  EXPECT_EQ(corners, report.corners_used);
}

}  // namespace
}  // namespace alidade
