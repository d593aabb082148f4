#include "alidade/beam/beam.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "alidade/beam/unit_direction.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

Beam draw_beam(Draws& draws) {
  Beam beam;
  beam.origin_in_cam = 0.1 * draws.normal3();
  beam.direction_in_cam = (Eigen::Vector3d::UnitZ() + 0.2 * draws.normal3()).normalized();
  beam.scale = draws.uniform(0.9, 1.1);
  return beam;
}

BeamMatrix draw_cov(Draws& draws, double sigma) {
  BeamMatrix A;
  for (int i = 0; i < 36; ++i) A(i / 6, i % 6) = sigma * draws.normal();
  return A * A.transpose();
}

TEST(UnitDirection, BasisIsOrthonormalEverywhere) {
  Draws draws(testing::make_rng()());
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector3d d = trial < 6 ? Eigen::Vector3d((trial % 2 ? 1 : -1) * Eigen::Vector3d::Unit(trial / 2))
                                        : Eigen::Vector3d(draws.normal3().normalized());
    Eigen::Matrix3d all;
    all << tangent_basis(d), d;
    EXPECT_LT((all.transpose() * all - Eigen::Matrix3d::Identity()).norm(), 1e-14);
    EXPECT_NEAR(all.determinant(), 1.0, 1e-14);
    EXPECT_NEAR(retract_direction(d, draws.normal2()).norm(), 1.0, 1e-15);
  }
}

TEST(Beam, ReadsWhatThePaperPrints) {
  // Wang & Li, Table 2: angles 1.557 and 1.586 rad are the direction (0.013796, −0.015203, 0.999789).
  Beam beam;
  beam.direction_in_cam = Eigen::Vector3d(0.013795889136731363, -0.015203087486108458, 0.9997892475786168);
  EXPECT_NEAR(direction_angles_rad(beam).x(), 1.557, 1e-12);
  EXPECT_NEAR(direction_angles_rad(beam).y(), 1.586, 1e-12);
}

TEST(Beam, JacobianOfThePointIsTheDerivative) {
  Draws draws(testing::make_rng()());
  for (int trial = 0; trial < 50; ++trial) {
    const Beam beam = draw_beam(draws);
    const double range_m = draws.uniform(0.2, 5.0);
    const auto J = J_point_beam(beam, range_m);
    for (int i = 0; i < num_beam_params; ++i) {
      constexpr double h = 1e-6;
      const BeamVector step = h * BeamVector::Unit(i);
      const Eigen::Vector3d numeric =
          (point_at(beam.retract(step), range_m) - point_at(beam.retract(-step), range_m)) / (2.0 * h);
      EXPECT_LT((numeric - J.col(i)).norm(), 1e-8) << "parameter " << i;
    }
  }
}

TEST(Beam, ItsMeetingWithAConstantIsAMovedOrigin) {
  Draws draws(testing::make_rng()());
  const Beam beam = draw_beam(draws);
  Beam moved = beam;
  moved.origin_in_cam -= beam.scale * 0.03 * beam.direction_in_cam;
  EXPECT_LT((point_at(beam, 1.5) - point_at(moved, 1.53)).norm(), 1e-15);
}

/// Covariance of the pixel against many draws of beam, lens and reading from their joint normal distribution.
TEST(Beam, PixelCovarianceIsThatOfDraws) {
  Draws draws(testing::make_rng()());
  Camera camera = *example_camera("brown", 1280, 960);
  Beam beam;
  beam.origin_in_cam = {0.05, -0.04, 0.02};
  beam.noise = {0.003, 0.001, 0.0};
  constexpr int num_lens = 10;
  Eigen::Matrix<double, 16, 16> A = Eigen::Matrix<double, 16, 16>::Zero();
  for (int i = 0; i < 256; ++i) A(i / 16, i % 16) = draws.normal();
  Eigen::Matrix<double, 16, 1> size;
  size << 1e-3, 1e-3, 1e-3, 5e-4, 5e-4, 1e-3, 0.3, 0.3, 0.3, 0.3, 0.05, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5;
  const Eigen::Matrix<double, 16, 16> root = size.asDiagonal() * A / 4.0, cov = root * root.transpose();
  beam.cov = cov.topLeftCorner<6, 6>();
  beam.cov_with_lens = cov.topRightCorner<6, num_lens>();
  camera.cov = cov.bottomRightCorner<num_lens, num_lens>();
  constexpr double range_m = 1.7;
  const auto pixel = measured_pixel(beam, camera, range_m);
  ASSERT_TRUE(pixel);
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  constexpr int trials = 20000;
  for (int trial = 0; trial < trials; ++trial) {
    Eigen::Matrix<double, 16, 1> z;
    for (int i = 0; i < 16; ++i) z[i] = draws.normal();
    const Eigen::Matrix<double, 16, 1> step = root * z;
    Camera other = camera;
    other.lens = with_params(camera.lens, params(camera.lens) + step.tail<num_lens>());
    const double read_m = range_m + beam.noise.sigma_at(range_m) * draws.normal();
    const Eigen::Vector2d away = *project(other, point_at(beam.retract(step.head<6>()), read_m)) - pixel->px;
    sum += away * away.transpose() / trials;
  }
  // A variance of 20000 draws is known to 1 %; five of that.
  const Eigen::Matrix2d L_inverse = Eigen::Matrix2d(pixel->cov.llt().matrixL()).inverse();
  EXPECT_LT((L_inverse * sum * L_inverse.transpose() - Eigen::Matrix2d::Identity()).norm(), 0.07);
}

TEST(Beam, EmbeddedCovarianceIsSingularAlongTheDirection) {
  Draws draws(testing::make_rng()());
  Beam beam = draw_beam(draws);
  beam.cov = draw_cov(draws, 0.01);
  const auto cov = embedded_covariance(beam);
  EXPECT_LT((cov.block<3, 3>(3, 3) * beam.direction_in_cam).norm(), 1e-18);
  EXPECT_LT((cov.topLeftCorner<3, 3>() - beam.cov.topLeftCorner<3, 3>()).norm(), 1e-18);
  EXPECT_NEAR(cov.block(3, 3, 3, 3).trace(), beam.cov.block(3, 3, 2, 2).trace(), 1e-16);
}

TEST(Beam, HasNoPixelBehindTheCamera) {
  Beam beam;
  beam.direction_in_cam = -Eigen::Vector3d::UnitZ();
  EXPECT_FALSE(measured_pixel(beam, *example_camera("pinhole", 640, 480), 1.0));
}

}  // namespace
}  // namespace alidade
