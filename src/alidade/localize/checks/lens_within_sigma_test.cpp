#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "alidade/localize.h"
#include "alidade/testing/hover.h"

// A lens as far from its file as the file's covariance says: nothing is wrong with it.

namespace alidade {
namespace {

/// Of a short calibration k1, k2 and k3 are hardly known apart: here by σ along what they have in common.
Localization with_distortion_off(double sigmas, double share_known, std::uint64_t seed) {
  testing::HoverRun run = testing::hovering({.num_frames = 200, .num_others = 30, .sigma_px = 0.2}, seed);
  Eigen::VectorXd lens = params(run.camera.lens), sigma = Eigen::VectorXd::Zero(10);
  sigma[5] = 0.005;
  sigma[6] = -0.021;
  sigma[9] = 0.025;
  run.camera.lens = with_params(run.camera.lens, lens + sigmas * sigma);
  run.camera.cov = share_known * share_known * sigma * sigma.transpose();
  LocalizeConfig config;
  config.target.points = run.target;
  config.sigma_times_s = 0.0;
  config.sigma_scale = 0.0005;
  return localize(run.frames, run.camera, config);
}

State radial_state(const Localization& result) {
  return std::ranges::find(result.verdict.checks, std::string("radial structure"), &Check::name)->state;
}

/// It was ◆ or ▲, "the lens is not as given", in one table of seven with 0.2 px.
TEST(LensWithinSigma, LeavesNoRadialStructure) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const Localization result = with_distortion_off(1.6, 1.0, seed);
    EXPECT_EQ(radial_state(result), State::good) << seed;
    EXPECT_EQ(result.verdict.state, State::good) << result.verdict.sentence;
  }
}

/// The same lens, where the file says that it is known far better.
TEST(LensWithinSigma, BeyondItIsNamed) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const Localization result = with_distortion_off(1.6, 0.05, seed);
    EXPECT_NE(radial_state(result), State::good) << seed;
  }
}

}  // namespace
}  // namespace alidade
