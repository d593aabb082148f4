#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "alidade/calibrate/setup.h"
#include "alidade/geometry/so3.h"
#include "alidade/testing/calibration_sample.h"

// A long lens and few photos, as people take them: in a narrow image a moved principal point, distortion and tilts do
// nearly the same, and the cost has several minima.

namespace alidade {
namespace {

constexpr double noise_px = 0.2;
const Board small_board{.cols = 7, .rows = 5, .square_m = 1.0};

/// Rotation vectors [°] and positions of the board's first corner [squares]: hand-held boards, mostly tilted one way.
BoardScene long_lens_scene() {
  constexpr std::array<std::array<double, 6>, 7> poses{{{-58, -42, -145, 8.4, 4.3, 62.8},
                                                        {-51, -19, -163, 2.2, 5.8, 52.2},
                                                        {-20, -21, -175, 3.6, 6.3, 48.8},
                                                        {-50, -44, -151, -5.5, 4.1, 65.8},
                                                        {-32, 0, -2, -3.0, 0.7, 68.2},
                                                        {-32, -18, -9, 3.8, 0.9, 65.6},
                                                        {-46, 45, 151, 2.4, 3.7, 67.7}}};
  BoardScene scene{
      testing::sample_camera(
          "brown",
          {{"fx", 1600.0}, {"fy", 1603.0}, {"cx", 330.0}, {"cy", 200.0}, {"k1", -0.2}, {"k2", 0.1}, {"k3", 0.0}}),
      small_board,
      points_in_board(small_board),
      {}};
  for (const auto& p : poses) {
    const Eigen::Vector3d turn = Eigen::Vector3d(p[0], p[1], p[2]) * std::numbers::pi / 180.0;
    scene.cam_from_board.push_back({exp_so3(turn), Eigen::Vector3d(p[3], p[4], p[5])});
  }
  return scene;
}

/// Σ of squared residuals [px²] of a solve that begins at the truth.
double least_near_the_truth(const BoardScene& scene, const std::vector<BoardView>& views) {
  BundleProblem problem;
  (void)set_up_problem(small_board, {}, testing::sample_size, problem);
  std::vector<ViewArrays> arrays;
  for (const BoardView& view : views) arrays.push_back(make_arrays(view));
  problem.views = arrays;
  const BundleResult result =
      solve_bundle(problem, {scene.camera.lens, scene.cam_from_board, scene.points_in_board}, {.max_iterations = 200});
  double sum = 0.0;
  for (std::size_t k = 0; k < arrays.size(); ++k)
    for (const Eigen::Vector2d& r : residuals_px(result.state, k, arrays[k])) sum += r.squaredNorm();
  return sum;
}

double squares_of(const CalibrateReport& report) {
  double sum = 0.0;
  for (const ViewFit& view : report.views)
    for (const CornerResidual& corner : view.corners) sum += corner.residual_px.squaredNorm();
  return sum;
}

TEST(SeveralMinima, TheLeastIsStatedAndSigmaReachesToTheOthers) {
  const BoardScene scene = long_lens_scene();
  constexpr int runs = 100;
  int worse = 0, with_others = 0, inside_2 = 0, converged = 0;
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    const std::vector<BoardView> views = simulate_views(scene, noise_px, seed);
    const CalibrateReport report =
        calibrate(small_board, views, testing::sample_size, {.board_shape = BoardShape::flat});
    if (report.status != CalibrateReport::Status::converged) continue;
    ++converged;
    // By less than one of χ² neither of two minima is the better answer.
    if (squares_of(report) - least_near_the_truth(scene, views) > noise_px * noise_px) ++worse;
    if (!report.other_lenses.empty()) ++with_others;
    const Eigen::VectorXd error = params(report.camera.lens) - params(scene.camera.lens);
    for (const int at : {0, 1, 2, 3, 5, 6, 7, 8, 9}) {
      const double z = std::abs(error[at]) / std::sqrt(report.camera.cov(at, at));
      inside_2 += z < 2.0 ? 1 : 0;
    }
  }
  EXPECT_GE(converged, 95);
  EXPECT_EQ(worse, 0);  // 5 by the solve that begins at the image's centre alone; up to 9 of χ²
  EXPECT_GT(with_others, 30);
  EXPECT_GT(inside_2, 0.90 * 9 * converged);
}

}  // namespace
}  // namespace alidade
