#include "alidade/camera/projection_sigma.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <chrono>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// A camera whose covariance is that of a plausible calibration: J Jᵀ over random points with motion left free.
Camera simulated_calibration(const Lens& lens, double spread) {
  Camera camera{1280, 960, lens, {}, 0.0, {}};
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> unit(-1.0, 1.0);
  const Eigen::Index num_params = params(lens).size();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(num_params, num_params);
  for (int view = 0; view < 30; ++view) {  // each view: the lens' information after its own pose is eliminated
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(num_params + 6, num_params + 6);
    const Eigen::Vector3d centre(spread * unit(rng), 0.75 * spread * unit(rng), 1.2);
    const Eigen::Quaterniond tilt = exp_so3({0.7 * unit(rng), 0.7 * unit(rng), unit(rng)});
    for (int i = 0; i < 54; ++i) {
      const Eigen::Vector3d point_in_cam = centre + tilt * Eigen::Vector3d(0.08 * (i % 9 - 4), 0.08 * (i / 9 - 2.5), 0);
      const auto at = project_with_jacobians(camera, point_in_cam);
      if (!at) continue;
      Eigen::MatrixXd J(2, num_params + 6);
      J << at->J_px_params, at->J_px_point, -at->J_px_point * cross_matrix(point_in_cam);
      H += J.transpose() * J / 0.09;  // 0.3 px corners
    }
    const Eigen::Index n = num_params;
    information += H.topLeftCorner(n, n) -
                   H.topRightCorner(n, 6) * Ldlt(H.bottomRightCorner(6, 6)).solve_each(H.bottomLeftCorner(6, n));
  }
  camera.cov = inverse_symmetric(information);
  return camera;
}

Camera distorted_camera() {
  return simulated_calibration(
      Calibrated<Brown>{Params<Brown>{900.0, 905.0, 640.0, 470.0, 0.5, -0.25, 0.1, 0.001, -0.0005, -0.02}}, 0.9);
}
Camera fisheye_camera() {
  return simulated_calibration(
      Calibrated<KannalaBrandt>{Params<KannalaBrandt>{700.0, 700.0, 640.0, 480.0, 0.0, -0.02, 0.004, -0.001, 1e-5}},
      3.0);
}

/// One draw of the lens, after the nonlinear weighted fit of the camera's motion: how far each pixel moved.
std::vector<Eigen::Vector2d> drawn_shift(const Camera& drawn, const std::vector<Eigen::Vector3d>& points_in_cam,
                                         const std::vector<Eigen::Vector2d>& pixels, const std::vector<double>& weights,
                                         bool with_translation) {
  Rigid3 drawn_from_cam;
  std::vector<Eigen::Vector2d> shift(pixels.size());
  for (int iteration = 0; iteration < 4; ++iteration) {
    Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Vector<double, 6> g = Eigen::Vector<double, 6>::Zero();
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const auto at = project_with_jacobians(drawn, drawn_from_cam * points_in_cam[i]).value();
      shift[i] = at.px - pixels[i];
      Eigen::Matrix<double, 2, 6> J;
      const Eigen::Matrix<double, 2, 3> J_rotated = at.J_px_point * drawn_from_cam.rotation.toRotationMatrix();
      J << J_rotated * (with_translation ? 1.0 : 0.0), -J_rotated * cross_matrix(points_in_cam[i]);
      H += weights[i] * J.transpose() * J;
      g += weights[i] * J.transpose() * shift[i];
    }
    if (!with_translation) H.topLeftCorner<3, 3>().setIdentity();
    drawn_from_cam = drawn_from_cam.retract(-solve_symmetric(H, g));
  }
  return shift;
}

/// The same quantity by Monte Carlo: scatter over draws of the lens, unweighted first, then weighted by its own result.
std::vector<double> scatter(const Camera& camera, const PixelGrid& grid, double distance_m, int num_draws) {
  std::vector<Eigen::Vector2d> pixels;
  std::vector<Eigen::Vector3d> points_in_cam;
  for (int row = 0; row < grid.rows; ++row) {
    for (int col = 0; col < grid.cols; ++col) {
      pixels.push_back(grid.px(col, row));
      points_in_cam.push_back((std::isfinite(distance_m) ? distance_m : 1.0) *
                              unproject(camera, pixels.back()).value());
    }
  }
  const Eigen::MatrixXd root = camera.cov.llt().matrixL();
  std::vector<double> weights(pixels.size(), 1.0), sigmas(pixels.size());
  for (int pass = 0; pass < 2; ++pass) {
    auto rng = testing::make_rng();
    std::normal_distribution<> standard;
    std::vector<Eigen::Matrix2d> sums(pixels.size(), Eigen::Matrix2d::Zero());
    for (int draw = 0; draw < num_draws; ++draw) {
      const Eigen::VectorXd dp = root * Eigen::VectorXd::NullaryExpr(root.rows(), [&] { return standard(rng); });
      Camera drawn = camera;
      drawn.lens = with_params(camera.lens, params(camera.lens) + dp);
      const auto shift = drawn_shift(drawn, points_in_cam, pixels, weights, std::isfinite(distance_m));
      for (std::size_t i = 0; i < shift.size(); ++i) sums[i] += shift[i] * shift[i].transpose() / num_draws;
    }
    for (std::size_t i = 0; i < sums.size(); ++i) {
      sigmas[i] = std::sqrt(symmetric_eigenvalues(sums[i])[1]);
      weights[i] = 1.0 / (sigmas[i] * sigmas[i]);
    }
  }
  return sigmas;
}

void expect_the_scatter(const Camera& camera, double distance_m) {
  constexpr int num_draws = 6000;
  const PixelGrid sigma = projection_sigma(camera, 7, 5, distance_m);
  const std::vector<double> expected = scatter(camera, make_grid(1280, 960, 7, 5), distance_m, num_draws);
  double mean_ratio = 0.0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    // σ of σ is 1/√(2·6000) = 0.9 %; the larger eigenvalue of a scatter is a little too large
    EXPECT_NEAR(sigma.values[i] / expected[i], 1.0, 0.05) << "pixel " << i << ": " << expected[i];
    mean_ratio += sigma.values[i] / expected[i] / static_cast<double>(expected.size());
  }
  EXPECT_NEAR(mean_ratio, 1.0, 0.03);
}

TEST(ProjectionSigma, IsTheScatterOfDrawnLensesAtInfinity) { expect_the_scatter(distorted_camera(), infinity); }
TEST(ProjectionSigma, IsTheScatterOfDrawnLensesAtAWorkingDistance) { expect_the_scatter(distorted_camera(), 1.2); }
TEST(ProjectionSigma, IsTheScatterOfDrawnFisheyes) { expect_the_scatter(fisheye_camera(), infinity); }

TEST(ProjectionSigma, IgnoresWhatTheMotionTakesUp) {
  // A principal point that is uncertain alone is, for a narrow image, a rotation: nearly nothing is left of 10 px.
  Camera camera{
      640, 480, Calibrated<Pinhole>{Params<Pinhole>{8000.0, 8000.0, 319.5, 239.5, 0.0}}, Eigen::MatrixXd::Zero(5, 5),
      0.0, {}};
  camera.cov(2, 2) = camera.cov(3, 3) = 100.0;
  for (const double sigma_px : projection_sigma(camera, 15, 11, infinity).values) EXPECT_LT(sigma_px, 0.05);
  // A focal length is not: it scales the image about its centre.
  camera.cov.setZero();
  camera.cov(0, 0) = camera.cov(1, 1) = 16.0;
  camera.cov(0, 1) = camera.cov(1, 0) = 16.0;
  const PixelGrid grid = projection_sigma(camera, 15, 11, infinity);
  EXPECT_NEAR(grid.values.front(), 4.0 * std::hypot(319.5, 239.5) / 8000.0, 1e-3);
  // …unless the distance is free: then a camera a little nearer shows the same.
  EXPECT_LT(projection_sigma(camera, 15, 11, 5.0).values.front(), 1e-2);
}

/// Which pixels of the grid are within 1 px of the image of some point inside the fold (k1, k2, p1, p2 as below).
std::vector<bool> pixels_seen_by_forward_mapping(const PixelGrid& grid) {
  std::vector<bool> covered(static_cast<std::size_t>(grid.cols * grid.rows), false);
  for (double r = 0.0; r < 0.98947; r += 0.001) {
    for (double phi = 0.0; phi < 2.0 * M_PI; phi += 0.002) {
      const double x = r * std::cos(phi), y = r * std::sin(phi), L = 1.0 + r * r * (-0.44881 + 0.0664 * r * r);
      const double u = 384.0 + 576.0 * (L * x + 0.0264 * x * y + 0.0022 * (r * r + 2.0 * x * x));
      const double v = 288.0 + 576.0 * (L * y + 0.0132 * (r * r + 2.0 * y * y) + 0.0044 * x * y);
      const int col = int(std::lround((u - grid.u0_px) / grid.du_px)), row = int(std::lround(v / grid.dv_px));
      if (col < 0 || col >= grid.cols || row < 0 || row >= grid.rows) continue;
      if ((grid.px(col, row) - Eigen::Vector2d(u, v)).norm() < 1.0) covered[std::size_t(row * grid.cols + col)] = true;
    }
  }
  return covered;
}

TEST(ProjectionSigma, IsNothingOutsideTheLensAndWithoutACovariance) {
  Camera camera{768,
                576,
                Calibrated<Brown>{Params<Brown>{576, 576, 384, 288, 0, -0.44881, 0.0664, 0.0132, 0.0022, 0}},
                Eigen::MatrixXd::Identity(10, 10) * 1e-6,
                0.0,
                {}};
  const PixelGrid grid = projection_sigma(camera, 60, 40, infinity);
  ASSERT_EQ(grid.values.size(), 2400u);
  const std::vector<bool> covered = pixels_seen_by_forward_mapping(grid);
  int num_seen = 0, num_otherwise = 0;
  for (std::size_t i = 0; i < covered.size(); ++i) {
    num_seen += covered[i];
    num_otherwise += covered[i] == std::isnan(grid.values[i]);
  }
  EXPECT_NEAR(num_seen, 0.79 * 2400, 50);  // a fifth of this image sees nothing
  EXPECT_LE(num_otherwise, 12);            // some of the pixels within 1 px of the edge
  camera.cov.resize(0, 0);
  for (const double sigma_px : projection_sigma(camera, 6, 4, infinity).values) EXPECT_TRUE(std::isnan(sigma_px));
}

TEST(Speed, ProjectionSigmaOfAnImageTakesMilliseconds) {
  const Camera camera = distorted_camera();
  double best_s = infinity;
  for (int i = 0; i < 5; ++i) {
    const auto start = std::chrono::steady_clock::now();
    (void)projection_sigma(camera, 60, 40, infinity);
    best_s = std::min(best_s, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  RecordProperty("milliseconds", std::to_string(1e3 * best_s));
#ifdef NDEBUG
  EXPECT_LT(best_s, 0.010);
#endif
}

}  // namespace
}  // namespace alidade
