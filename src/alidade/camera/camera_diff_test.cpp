#include "alidade/camera/camera_diff.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alidade/testing/random.h"

namespace alidade {
namespace {

Camera brown_camera() {
  return {
      1280, 960, Calibrated<Brown>{Params<Brown>{900.0, 905.0, 640.0, 470.0, 0.0, -0.25, 0.1, 0.001, -0.0005, -0.02}},
      {},   0.0, {}};
}

/// A covariance with correlations, of the size that a good calibration has.
Eigen::MatrixXd covariance(double scale) {
  auto rng = testing::make_rng();
  std::normal_distribution<> standard;
  const Eigen::VectorXd sigma =
      scale * (Eigen::VectorXd(10) << 0.5, 0.5, 0.6, 0.6, 0.1, 1e-3, 2e-3, 1e-4, 1e-4, 1e-3).finished();
  const Eigen::MatrixXd mix = Eigen::MatrixXd::NullaryExpr(10, 10, [&] { return standard(rng); }) / 4.0;
  const Eigen::MatrixXd root = sigma.asDiagonal() * (Eigen::MatrixXd::Identity(10, 10) + mix);
  return root * root.transpose();
}

Camera drawn_from(const Camera& camera, std::mt19937_64& rng) {
  std::normal_distribution<> standard;
  const Eigen::MatrixXd root = camera.cov.llt().matrixL();
  Camera drawn = camera;
  drawn.lens = with_params(camera.lens, params(camera.lens) + root * Eigen::VectorXd::NullaryExpr(
                                                                         root.rows(), [&] { return standard(rng); }));
  return drawn;
}

TEST(CameraDiff, OfACameraWithItselfIsNothing) {
  const auto diff = diff_cameras(brown_camera(), brown_camera());
  ASSERT_TRUE(diff);
  EXPECT_EQ(diff->num_compared, 2400u);
  EXPECT_LT(diff->max_px, 1e-9);
  EXPECT_LT(log_so3(diff->b_from_a.rotation).norm(), 1e-12);
  EXPECT_TRUE(std::isnan(diff->rms_in_sigmas));
  ASSERT_EQ(diff->parameters.size(), 10u);
  EXPECT_EQ(diff->parameters[5].name, "k1");
  EXPECT_TRUE(std::isnan(diff->parameters[5].sigma_a));
}

TEST(CameraDiff, TakesAKnownRotationOut) {
  // A pinhole whose image was rotated about the optical axis needs skew-free lenses: rotation about z by re-labelling.
  // b = a with the principal point moved: for a long lens that is a rotation of Δc/f.
  Camera a{640, 480, Calibrated<Pinhole>{Params<Pinhole>{8000.0, 8000.0, 319.5, 239.5, 0.0}}, {}, 0.0, {}};
  Camera b = a;
  std::get<Calibrated<Pinhole>>(b.lens).params[2] += 8.0;
  const auto diff = diff_cameras(a, b);
  ASSERT_TRUE(diff);
  EXPECT_NEAR(log_so3(diff->b_from_a.rotation).y(), -8.0 / 8000.0, 1e-6);
  EXPECT_LT(diff->max_px, 0.02);  // what is left is of second order: 8 px · (r/f)²
  EXPECT_LT(diff->central_rms_px, diff->rms_px + 1e-9);
}

TEST(CameraDiff, AtADistanceTakesAMotionAlongTheAxisOut) {
  Camera a = brown_camera(), b = brown_camera();
  auto& values = std::get<Calibrated<Brown>>(b.lens).params;
  values[0] *= 1.01, values[1] *= 1.01;
  const auto at_infinity = diff_cameras(a, b);
  const auto near = diff_cameras(a, b, {.distance_m = 2.0});
  ASSERT_TRUE(at_infinity && near);
  EXPECT_GT(at_infinity->rms_px, 2.0);
  EXPECT_LT(near->rms_px, 0.5 * at_infinity->rms_px);
  EXPECT_GT(near->b_from_a.translation.z(), 0.0);  // b is longer: it shows the same from further away
  EXPECT_NEAR(near->b_from_a.translation.z(), 0.01 * 2.0, 0.01);
}

TEST(CameraDiff, IsAboutOneSigmaWhereTheCamerasAgree) {
  Camera truth = brown_camera();
  truth.cov = covariance(1.0);
  auto rng = testing::make_rng();
  constexpr int num_pairs = 400;
  double sum = 0.0, sum_of_squares = 0.0;
  for (int i = 0; i < num_pairs; ++i) {
    const auto diff =
        diff_cameras(drawn_from(truth, rng), drawn_from(truth, rng), {.cols = 9, .rows = 7, .distance_m = 1.5});
    ASSERT_TRUE(diff);
    const double mean_square = diff->rms_in_sigmas * diff->rms_in_sigmas;
    sum += mean_square, sum_of_squares += mean_square * mean_square;
  }
  const double mean = sum / num_pairs, error = std::sqrt((sum_of_squares / num_pairs - mean * mean) / num_pairs);
  EXPECT_NEAR(mean, 1.0, 4.0 * error);
  EXPECT_LT(error, 0.06);  // or the line above says nothing
}

TEST(CameraDiff, SaysManySigmasWhereTheyDiffer) {
  Camera a = brown_camera(), b = brown_camera();
  a.cov = b.cov = covariance(0.2);
  std::get<Calibrated<Brown>>(b.lens).params[5] += 0.02;
  const auto diff = diff_cameras(a, b);
  ASSERT_TRUE(diff);
  EXPECT_GT(diff->max_in_sigmas, 10.0);
  // One side's covariance is enough to say so, and says more.
  a.cov.resize(0, 0);
  const auto one_sided = diff_cameras(a, b);
  ASSERT_TRUE(one_sided);
  EXPECT_TRUE(std::isnan(one_sided->sigma_a.values[0]));
  EXPECT_GT(one_sided->rms_in_sigmas, diff->rms_in_sigmas);
}

TEST(CameraDiff, ComparesLensesOfDifferentModels) {
  // An equidistant fisheye and a Brown lens that agree near the centre: θ ≈ r − r³/3 + r⁵/5.
  const Camera fisheye{640, 480, Calibrated<KannalaBrandt>{Params<KannalaBrandt>{900, 900, 320, 240, 0, 0, 0, 0, 0}},
                       {},  0.0, {}};
  const Camera brown{640, 480, Calibrated<Brown>{Params<Brown>{900, 900, 320, 240, 0, -1.0 / 3, 0.2, 0, 0, -1.0 / 7}},
                     {},  0.0, {}};
  const auto diff = diff_cameras(fisheye, brown);
  ASSERT_TRUE(diff);
  EXPECT_TRUE(diff->parameters.empty());
  EXPECT_LT(diff->central_rms_px, 1e-4);
  const double r = std::tan(400.0 / 900.0);  // the corner; the series' next term is r⁹/9
  EXPECT_LT(diff->max_px, 1.2 * 900.0 * std::pow(r, 9) / 9.0);
  EXPECT_GT(diff->max_px, 0.01);
}

TEST(CameraDiff, ARegionThatFailsDoesNotTurnTheImage) {
  // b is a with strong k3: only the corners differ, by tens of pixels, and more on one side (its principal point).
  Camera a = brown_camera(), b = brown_camera();
  auto& values = std::get<Calibrated<Brown>>(b.lens).params;
  values[9] += 0.25;
  const auto diff = diff_cameras(a, b);
  ASSERT_TRUE(diff);
  EXPECT_GT(diff->max_px, 20.0);
  EXPECT_LT(diff->central_rms_px, 0.1);
}

TEST(CameraDiff, HasNoAnswerForDifferentSizesOrNothingInCommon) {
  Camera a = brown_camera(), b = brown_camera();
  b.width_px = 640;
  EXPECT_FALSE(diff_cameras(a, b));
  b = a;
  std::get<Calibrated<Brown>>(b.lens).params[5] = -1e9;  // sees nothing but its centre
  EXPECT_FALSE(diff_cameras(a, b));
}

}  // namespace
}  // namespace alidade
