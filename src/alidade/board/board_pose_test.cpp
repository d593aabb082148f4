#include "alidade/board/board_pose.h"

#include <gtest/gtest.h>

#include "alidade/board/board.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

const std::vector<Eigen::Vector3d> points = points_in_board({.cols = 9, .rows = 6, .square_m = 0.04});

Rigid3 draw_pose(Draws& draws) {
  const double azimuth = draws.uniform(-3.1, 3.1), tilt = draws.uniform(0.0, 0.8), z_m = draws.uniform(0.7, 3.5);
  const Eigen::Quaterniond rotation = exp_so3({tilt * std::cos(azimuth), tilt * std::sin(azimuth), 0.0}) *
                                      exp_so3({0.0, 0.0, draws.uniform(-3.0, 3.0)});
  const Eigen::Vector3d centre_in_board(0.16, 0.1, 0.0);
  const Eigen::Vector3d centre_in_cam(draws.uniform(-0.1, 0.1) * z_m, draws.uniform(-0.1, 0.1) * z_m, z_m);
  return {rotation, centre_in_cam - rotation * centre_in_board};
}

BoardView see(const Camera& camera, const Rigid3& cam_from_board, double sigma_px, Draws& draws) {
  BoardView view;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto px = project(camera, cam_from_board * points[i]);
    const Eigen::Vector2d noise = sigma_px * draws.normal2();
    if (px)
      view.corners.push_back({static_cast<int>(i), *px + noise, sigma_px * sigma_px * Eigen::Matrix2d::Identity()});
  }
  return view;
}

TEST(BoardPose, IsExactWithoutNoiseBehindEveryLens) {
  Draws draws(testing::make_rng()());
  int checked = 0;
  for (const char* model : {"pinhole", "brown", "kannala_brandt"}) {
    const Camera camera = *example_camera(model, 1280, 960);
    for (int trial = 0; trial < 50; ++trial) {
      const Rigid3 cam_from_board = draw_pose(draws);
      const BoardView view = see(camera, cam_from_board, 0.0, draws);
      if (view.corners.size() < points.size()) continue;
      const auto fit = fit_board_pose(camera, view, points, 0.1);
      ASSERT_TRUE(fit);
      const Rigid3 board_from_board = fit->pose.cam_from_board.inverse() * cam_from_board;
      EXPECT_LT(board_from_board.translation.norm(), 1e-8);
      EXPECT_LT(log_so3(board_from_board.rotation).norm(), 1e-8);
      ++checked;
    }
  }
  EXPECT_GT(checked, 100);  // of 150: some boards reach out of what a lens sees
}

TEST(BoardPose, CovarianceIsThatOfTheErrors) {
  Draws draws(testing::make_rng()());
  const Camera camera = *example_camera("brown", 1280, 960);
  double sum = 0.0;
  constexpr int trials = 400;
  for (int trial = 0; trial < trials; ++trial) {
    const Rigid3 cam_from_board = draw_pose(draws);
    const auto fit = fit_board_pose(camera, see(camera, cam_from_board, 0.1, draws), points);
    ASSERT_TRUE(fit);
    const Rigid3 error = fit->pose.cam_from_board.inverse() * cam_from_board;
    Eigen::Matrix<double, 6, 1> xi;
    xi << error.translation, log_so3(error.rotation);
    sum += squared_mahalanobis(xi, fit->pose.cov);
  }
  // χ² of 6·400 degrees of freedom: σ is √4800 = 69; far and frontal boards are a little worse than linear.
  EXPECT_NEAR(sum / trials, 6.0, 5.0 * std::sqrt(12.0 / trials));
}

TEST(BoardPose, FollowsTheLensAsItSays) {
  Draws draws(testing::make_rng()());
  const Camera camera = *example_camera("brown", 1280, 960);
  const BoardView view = see(camera, draw_pose(draws), 0.0, draws);
  const auto fit = fit_board_pose(camera, view, points, 0.1);
  ASSERT_TRUE(fit);
  const Eigen::VectorXd values = params(camera.lens);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const double h = 1e-4 * std::max(1e-2, std::abs(values[i]));
    const auto moved = [&](double by) {
      Eigen::VectorXd changed = values;
      changed[i] += by;
      Camera other = camera;
      other.lens = with_params(camera.lens, changed);
      return fit_board_pose(other, view, points, 0.1)->pose.cam_from_board;
    };
    const Rigid3 change = moved(-h).inverse() * moved(h);
    Eigen::Matrix<double, 6, 1> xi;
    xi << change.translation, log_so3(change.rotation);
    const Eigen::Matrix<double, 6, 1> numeric = xi / (2.0 * h);
    EXPECT_LT((numeric - fit->J_pose_lens.col(i)).norm(), 1e-4 * (1e-3 + numeric.norm())) << "parameter " << i;
  }
}

// Where the two poses that look alike meet, and where a board is a few pixels large. One in 1000 had none by steps
// along the slope alone.
TEST(BoardPose, IsFoundWhereTwoPosesMeetAndFarAway) {
  Draws draws(testing::make_rng()());
  const Camera camera = *example_camera("brown", 640, 480);
  for (const double z_m : {2.7, 4.0, 5.0, 10.5}) {
    double sum = 0.0;
    constexpr int trials = 1500;
    for (int trial = 0; trial < trials; ++trial) {
      const double azimuth = draws.uniform(-3.1, 3.1), tilt = draws.uniform(0.0, z_m > 10.0 ? 0.8 : 0.2);
      const Eigen::Quaterniond rotation = exp_so3({tilt * std::cos(azimuth), tilt * std::sin(azimuth), 0.0});
      const Eigen::Vector3d centre_in_cam(draws.uniform(-0.1, 0.1) * z_m, draws.uniform(-0.1, 0.1) * z_m, z_m);
      const Rigid3 cam_from_board{rotation, centre_in_cam - rotation * Eigen::Vector3d(0.16, 0.1, 0.0)};
      const auto fits = fit_board_poses(camera, see(camera, cam_from_board, 0.1, draws), points);
      ASSERT_FALSE(fits.empty()) << "z " << z_m << ", trial " << trial;
      sum += fits.front().chi2 / fits.front().dof;
    }
    EXPECT_NEAR(sum / trials, 1.0, 5.0 * std::sqrt(2.0 / 102.0 / trials)) << z_m;  // the least, not merely an end
  }
}

TEST(BoardPose, HasNoneWhereThereIsNone) {
  const Camera camera = *example_camera("pinhole", 1280, 960);
  BoardView line, strange, wrong_number;
  for (int i = 0; i < 9; ++i) line.corners.push_back({i, {100.0 + 30.0 * i, 200.0}});
  for (int i = 0; i < 54; ++i) strange.corners.push_back({i, {std::nan(""), 1e300}});
  for (int i = 50; i < 60; ++i) wrong_number.corners.push_back({i, {100.0 + 30.0 * i, 200.0 + i * i}});
  EXPECT_FALSE(fit_board_pose(camera, line, points, 0.1));
  EXPECT_FALSE(fit_board_pose(camera, strange, points, 0.1));
  EXPECT_FALSE(fit_board_pose(camera, wrong_number, points, 0.1));
  EXPECT_FALSE(fit_board_pose(camera, BoardView{}, points, 0.1));
}

}  // namespace
}  // namespace alidade
