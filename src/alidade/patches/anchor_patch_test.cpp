#include "alidade/patches/anchor_patch.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>
#include <opencv2/core.hpp>

#include "alidade/testing/random.h"

namespace alidade {
namespace {

/// A smooth texture with corners every few pixels, as a function of the position: no interpolation is involved.
double texture(const Eigen::Vector2d& at) {
  double sum = 0.0;
  for (int i = 0; i < 12; ++i) {
    const double angle = 2.4 * i, per_px = 0.3 + 0.035 * i;
    sum += std::sin(per_px * (std::cos(angle) * at.x() + std::sin(angle) * at.y()) + 1.7 * i);
  }
  return 120.0 + 18.0 * sum;
}

/// Image of the texture warped: what was at d from (22, 22) is seen at pose.px + pose.linear d.
cv::Mat image(const PatchPose& pose, double noise, std::mt19937_64& rng) {
  std::normal_distribution<double> normal;
  cv::Mat made(44, 44, CV_32F);
  for (int v = 0; v < made.rows; ++v)
    for (int u = 0; u < made.cols; ++u) {
      const Eigen::Vector2d offset = pose.linear.inverse() * (Eigen::Vector2d(u, v) - pose.px);
      made.at<float>(v, u) = static_cast<float>(pose.bias + pose.gain * texture(Eigen::Vector2d(22.0, 22.0) + offset) +
                                                noise * normal(rng));
    }
  return smoothed_for_patches(made);
}

PatchPose drawn_pose(std::mt19937_64& rng) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  PatchPose pose;
  pose.px = Eigen::Vector2d(22.0, 22.0) + Eigen::Vector2d(uniform(rng), uniform(rng));
  for (double& entry : pose.linear.reshaped()) entry += 0.05 * uniform(rng);
  pose.gain = 1.0 + 0.1 * uniform(rng);
  pose.bias = 10.0 * uniform(rng);
  return pose;
}

TEST(AnchorPatch, FindsPlaceWarpAndLight) {
  std::mt19937_64 rng = testing::make_rng();
  const AnchorPatch patch(image({.px = {22.0, 22.0}}, 0.0, rng), 22, 22);
  for (int trial = 0; trial < 20; ++trial) {
    const PatchPose truth = drawn_pose(rng);
    const PatchFit fit = patch.align(image(truth, 0.0, rng), {.px = {22.0, 22.0}});
    ASSERT_TRUE(fit.converged);
    EXPECT_LT((fit.pose.px - truth.px).norm(), 0.01);  // the smoothing is not warped along: 5 % of its σ of 0.7 px
    EXPECT_LT((fit.pose.linear - truth.linear).norm(), 0.004);
    EXPECT_NEAR(fit.pose.gain, truth.gain, 0.01);
  }
}

/// Errors of many noisy images of one patch against their covariance: their mean square, per coordinate, and mean.
TEST(AnchorPatch, CovarianceCoversTheNoise) {
  std::mt19937_64 rng = testing::make_rng();
  const AnchorPatch patch(image({.px = {22.0, 22.0}}, 0.0, rng), 22, 22);
  constexpr int num_trials = 400;
  constexpr double noise = 3.0;
  double nees = 0.0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (int trial = 0; trial < num_trials; ++trial) {
    PatchPose truth;
    truth.px = drawn_pose(rng).px;
    const PatchFit fit = patch.align(image(truth, noise, rng), {.px = {22.0, 22.0}});
    ASSERT_TRUE(fit.converged);
    const Eigen::Vector2d error = fit.pose.px - truth.px;
    // This anchor is clean: half of what two noisy images would leave, so the stated variance is half the real one.
    nees += error.dot(fit.cov.inverse() * error) / num_trials / 2.0;
    mean += error / num_trials;
  }
  // Two noisy images leave 1.98 times the squares that are left here: that is expected, ± 0.1 by chance, and some 3 %
  // more because the noise is estimated from one patch.
  EXPECT_GT(nees, 1.75);
  EXPECT_LT(nees, 2.4);
  EXPECT_LT(mean.norm(), 0.005);  // σ ≈ 0.03 px: ± 0.002
}

TEST(AnchorPatch, IsNotFoundOutsideOrElsewhere) {
  std::mt19937_64 rng = testing::make_rng();
  const cv::Mat seen = image({.px = {22.0, 22.0}}, 0.0, rng);
  const AnchorPatch patch(seen, 22, 22);
  EXPECT_FALSE(patch.align(seen, {.px = {3.0, 22.0}}).converged);
  EXPECT_FALSE(patch.align(seen, {.px = {22.0, std::numeric_limits<double>::quiet_NaN()}}).converged);
  const cv::Mat flat(44, 44, CV_32F, cv::Scalar(100.0));
  const PatchFit fit = patch.align(flat, {.px = {22.0, 22.0}});
  EXPECT_TRUE(!fit.converged || fit.rms > 0.5 * patch.contrast());
}

}  // namespace
}  // namespace alidade
