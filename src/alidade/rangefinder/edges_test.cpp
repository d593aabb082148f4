#include "alidade/rangefinder/solve/align_edges.h"

#include <gtest/gtest.h>

#include "alidade/testing/edge_scene.h"

namespace alidade {
namespace {

using testing::edge_camera;
using testing::photo_of;
using testing::scan_of;

TEST(Edges, FindTheDirectionToSomeMrad) {
  const Camera camera = edge_camera();
  Beam truth;
  truth.origin_in_cam = {0.04, -0.05, 0.0};
  truth.direction_in_cam = Eigen::Vector3d(0.03, -0.025, 1.0).normalized();
  const EdgesConfig config{.blur_px = {12.0, 6.0, 3.0}};  // a quarter of the image, a quarter of the blur and more
  const EdgesReport report = align_edges(scan_of(truth, 0.0044), photo_of(camera), camera, Beam{}, config);
  // 8.4 mrad is the median of a scan half as fine in another program; the start is 39 mrad away.
  EXPECT_LT((report.beam.direction_in_cam - truth.direction_in_cam).norm(), 0.0084);
  // σ covers it, and the origin that it makes up for: where the beam is seen, near and far.
  for (const double range_m : {1.0, 2.0, 4.0}) {
    const auto seen = measured_pixel(report.beam, camera, range_m, 0.0);
    const auto expected = project(camera, point_at(truth, range_m));
    ASSERT_TRUE(seen && expected);
    for (int i = 0; i < 2; ++i) EXPECT_NEAR(seen->px[i], (*expected)[i], 3.0 * std::sqrt(seen->cov(i, i))) << range_m;
  }
  EXPECT_LT(std::sqrt(report.beam.cov(3, 3)), 0.03);
  const Verdict verdict = edges_verdict(report);
  EXPECT_TRUE(verdict.state == State::care)
      << verdict.sentence << report.num_edges << " " << report.gain << " " << report.halves_differ_rad << " "
      << report.beam.direction_in_cam.transpose();
}

TEST(Edges, RefuseASceneWithoutDepthAndAnotherPhoto) {
  const Camera camera = edge_camera();
  std::vector<ScanRow> flat = scan_of({}, 0.02);
  for (ScanRow& row : flat) row.range_m = 4.0;
  EXPECT_TRUE(edges_verdict(align_edges(flat, photo_of(camera), camera, {})).exit_code == ExitCode::undetermined);
  GreyImage grey = photo_of(camera);
  std::fill(grey.values.begin(), grey.values.end(), 100.0F);
  const auto nothing = align_edges(scan_of({}, 0.0088), grey, camera, {});
  EXPECT_TRUE(edges_verdict(nothing).exit_code == ExitCode::undetermined);
  EXPECT_TRUE(edges_verdict(align_edges({}, {}, camera, {})).exit_code == ExitCode::undetermined);
}

}  // namespace
}  // namespace alidade
