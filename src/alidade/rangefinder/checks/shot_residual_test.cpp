#include "alidade/rangefinder/checks/shot_residual.h"

#include <gtest/gtest.h>

#include "alidade/geometry/so3.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

struct Sample {
  Beam beam;
  Camera camera;
  PreparedShot shot;
};

Sample draw_sample(Draws& draws, const char* model, bool has_plane, bool has_spot) {
  Sample sample{{}, *example_camera(model, 1280, 960), {}};
  sample.beam.origin_in_cam = 0.05 * draws.normal3();
  sample.beam.direction_in_cam = (Eigen::Vector3d::UnitZ() + 0.05 * draws.normal3()).normalized();
  sample.beam.scale = draws.uniform(0.95, 1.05);
  sample.shot.range_m = draws.uniform(0.6, 3.0);
  const Eigen::Vector3d hit = point_at(sample.beam, sample.shot.range_m);
  if (has_plane) {
    const Eigen::Quaterniond rotation = exp_so3(0.3 * draws.normal3());
    sample.shot.pose = BoardPose{{rotation, hit + rotation * Eigen::Vector3d(0.1, -0.05, 0.01)}, {}};
    sample.shot.plane = plane_of(sample.shot.pose->cam_from_board);
  }
  if (has_spot) sample.shot.spot_px = *project(sample.camera, hit) + draws.normal2();
  return sample;
}

using Rows = ShotResidual::Rows;

Rows residual_at(const Sample& sample, bool twice) {
  return shot_residual(sample.shot, sample.beam, sample.camera, {{}, twice})->r;
}

/// Central differences of the residual by one number that `move` changes by h.
template <class Move>
Rows derivative(const Sample& sample, bool twice, double h, const Move& move) {
  Sample more = sample, less = sample;
  move(more, h);
  move(less, -h);
  return (residual_at(more, twice) - residual_at(less, twice)) / (2.0 * h);
}

class ShotResidualJacobian : public ::testing::TestWithParam<std::tuple<const char*, int, bool>> {};

TEST_P(ShotResidualJacobian, IsTheDerivative) {
  const auto [model, has, twice] = GetParam();
  Draws draws(testing::make_rng()());
  for (int trial = 0; trial < 30; ++trial) {
    const Sample sample = draw_sample(draws, model, has & 1, has & 2);
    const auto at = shot_residual(sample.shot, sample.beam, sample.camera, {{}, twice});
    ASSERT_TRUE(at);
    const auto expect = [&](const Rows& numeric, const Rows& analytic, const std::string& what) {
      EXPECT_LT((numeric - analytic).norm(), 1e-5 * (1.0 + numeric.norm())) << what;
    };
    for (int i = 0; i < num_beam_params; ++i) {
      const auto move = [&](Sample& s, double h) { s.beam = s.beam.retract(h * BeamVector::Unit(i)); };
      expect(derivative(sample, twice, 1e-6, move), at->J_beam.col(i), "beam " + std::to_string(i));
    }
    for (int i = 0; i < 6 && (has & 1); ++i) {
      const auto move = [&](Sample& s, double h) {
        s.shot.pose->cam_from_board = s.shot.pose->cam_from_board.retract(h * Eigen::Vector<double, 6>::Unit(i));
        s.shot.plane = plane_of(s.shot.pose->cam_from_board);
      };
      expect(derivative(sample, twice, 1e-6, move), at->J_pose.col(i), "pose " + std::to_string(i));
    }
    for (int i = 0; i < 4 && (has & 1); ++i) {
      const auto move = [&](Sample& s, double h) { (i < 3 ? s.shot.plane->normal_in_cam[i] : s.shot.plane->d_m) += h; };
      expect(derivative(sample, twice, 1e-6, move), at->J_plane.col(i), "plane " + std::to_string(i));
    }
    for (Eigen::Index i = 0; i < at->J_lens.cols(); ++i) {
      const auto move = [&](Sample& s, double h) {
        Eigen::VectorXd values = params(s.camera.lens);
        values[i] += h;
        s.camera.lens = with_params(s.camera.lens, values);
      };
      expect(derivative(sample, twice, 1e-5, move), at->J_lens.col(i), "lens " + std::to_string(i));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, ShotResidualJacobian,
                         ::testing::Combine(::testing::Values("pinhole", "brown", "kannala_brandt"),
                                            ::testing::Values(1, 2, 3), ::testing::Bool()));

/// The covariance that whitens is that of residuals whose reading, spot and pose are drawn with noise.
TEST(ShotResidual, CovarianceIsThatOfDraws) {
  Draws draws(testing::make_rng()());
  for (const int has : {1, 2, 3}) {
    Sample sample = draw_sample(draws, "brown", has & 1, has & 2);
    sample.shot.sigma_range_m = 0.003;
    sample.shot.sigma_spot_px = 0.4;
    const auto spot_px = project(sample.camera, point_at(sample.beam, sample.shot.range_m));
    if (has & 2) sample.shot.spot_px = *spot_px;
    Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Zero();
    for (int i = 0; i < 36; ++i) root(i / 6, i % 6) = 5e-4 * draws.normal();
    if (has & 1) sample.shot.pose->cov = root * root.transpose();
    const auto at = shot_residual(sample.shot, sample.beam, sample.camera, {});
    const Eigen::MatrixXd cov = full_covariance(sample.shot, *at);
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(cov.rows(), cov.cols());
    constexpr int trials = 20000;
    for (int trial = 0; trial < trials; ++trial) {
      Sample noisy = sample;
      noisy.shot.range_m += 0.003 * draws.normal();
      if (has & 2) *noisy.shot.spot_px += 0.4 * draws.normal2();
      Eigen::Vector<double, 6> z;
      for (int i = 0; i < 6; ++i) z[i] = draws.normal();
      if (has & 1) {
        noisy.shot.pose->cam_from_board = noisy.shot.pose->cam_from_board.retract(root * z);
        noisy.shot.plane = plane_of(noisy.shot.pose->cam_from_board);
      }
      const Rows away = residual_at(noisy, false) - at->r;
      sum += away * away.transpose() / trials;
    }
    const Eigen::MatrixXd W = whitener_of(cov);
    // 1 % a variance, seven elements, five σ.
    EXPECT_LT((W * sum * W.transpose() - Eigen::MatrixXd::Identity(cov.rows(), cov.cols())).norm(), 0.1) << has;
  }
}

TEST(ShotResidual, HasNoneWhereTheBeamMissesThePlane) {
  PreparedShot shot;
  shot.range_m = 1.0;
  shot.plane = Plane{Eigen::Vector3d::UnitX(), -1.0, Eigen::Matrix4d::Zero()};  // along the beam
  EXPECT_FALSE(shot_residual(shot, Beam{}, *example_camera("pinhole", 640, 480), {}));
  shot.plane = Plane{Eigen::Vector3d::UnitZ(), 1.0, Eigen::Matrix4d::Zero()};  // behind
  EXPECT_FALSE(shot_residual(shot, Beam{}, *example_camera("pinhole", 640, 480), {}));
}

}  // namespace
}  // namespace alidade
