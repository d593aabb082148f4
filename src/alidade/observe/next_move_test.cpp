#include "alidade/observe/next_move.h"

#include <gtest/gtest.h>

#include "alidade/observe/solve/rotation_bundle.h"
#include "alidade/simulate/rotation.h"

namespace alidade {
namespace {

/// σ of fx, fy, cx, cy that the paper's motion leaves after `duration_s`: its Cramér–Rao bound.
Eigen::Vector4d bound_of_paper_motion(const std::vector<Eigen::Vector2d>& points, double duration_s, double sigma_px) {
  RotationScene scene;
  scene.start_px = points;
  scene.motion = paper_rate;
  RotationLogConfig how;
  how.duration_s = duration_s;
  how.sigma_px = 0.0;
  const RotationLog log = simulate_rotation(scene, how, 1);
  RotationBundle bundle;
  bundle.camera.k = {710.0 / 390.0, 700.0 / 390.0, 0.5 / 390.0, -0.5 / 390.0};
  MotionReader reader(log.source, 0.25);
  const PixelScale scale{{389.5, 290.5}, 390.0};
  for (const Eigen::Vector2d& px : points) {
    const auto ray = RotationView(bundle.camera, RotationFrame{}).ray_in_start(scale.normalised(px));
    bundle.points.push_back({rotation_to(*ray), Eigen::Vector2d::Zero(), 0.0});
  }
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    bundle.frames.push_back(reader.next(log.rows[k]));
    for (std::size_t i = 0; i < points.size(); ++i) {
      bundle.observations.push_back({static_cast<int>(k), static_cast<int>(i), scale.normalised(log.rows[k].px[i])});
    }
  }
  RotationBundleConfig config;
  config.sigma_px = sigma_px / 390.0;
  config.max_iterations = 0;
  config.huber = 0.0;
  return solve_rotation_bundle(bundle, CommonPrior(bundle.camera), config).bound().diagonal().head<4>().cwiseSqrt() *
         390.0;
}

TEST(NextMove, ReachesThePapersAccuracyInAThirdOfTheTime) {
  constexpr double paper_s = 6.0;
  double planned_squares = 0.0, paper_squares = 0.0;
  for (std::uint64_t set = 1; set <= 20; ++set) {
    ObservedNow now{780, 582,  {710.0, 700.0, 390.0, 290.0}, Eigen::Vector4d(4e4, 4e4, 2500.0, 2500.0).asDiagonal(),
                    {},  0.316};
    now.points_px = draw_points(780, 582, 4, set);
    paper_squares += bound_of_paper_motion(now.points_px, paper_s, now.sigma_px).squaredNorm();
    double elapsed_s = 0.0;
    Eigen::Vector4d sigma_px = now.cov_px2.diagonal().cwiseSqrt();
    // A head of 46°/s. One as slow as the paper's motion (7°/s at most) cannot be three times as quick as it.
    for (const NextMove& move : plan_next_moves(now, {.rate_rad_per_s = 0.8, .max_turn_rad = 0.3}, 8)) {
      elapsed_s += move.duration_s;
      if (elapsed_s > paper_s / 3.0) break;
      sigma_px = move.sigma_px;
    }
    planned_squares += sigma_px.squaredNorm();
  }
  // Over the sets together; of single sets of four points two in three are as good.
  EXPECT_LE(planned_squares, paper_squares);
}

TEST(NextMove, AsksForATiltWhereAPanHasSaidAllItCan) {
  ObservedNow now{780, 582, {710.0, 700.0, 390.0, 290.0}, Eigen::Vector4d(0.1, 4e4, 0.1, 2500.0).asDiagonal(), {}, 0.3};
  now.points_px = draw_points(780, 582, 4, 1);
  const auto moves = plan_next_moves(now, {}, 1);
  ASSERT_EQ(moves.size(), 1u);
  EXPECT_GT(std::abs(moves[0].pan_tilt_roll_rad.y()), 0.1);
  EXPECT_LT(moves[0].sigma_px[1], 20.0);
}

TEST(NextMove, HasNoneWithoutPoints) {
  ObservedNow now;
  now.width_px = 780;
  now.height_px = 582;
  EXPECT_TRUE(plan_next_moves(now, {}, 3).empty());
}

}  // namespace
}  // namespace alidade
