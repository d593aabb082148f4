#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "alidade/localize.h"
#include "alidade/testing/hover.h"
#include "alidade/testing/trials.h"

// What is not as given, of a target that does not stand still: its score tests.

namespace alidade {
namespace {

Localization of(const testing::Hover& scene, std::uint64_t seed) {
  testing::HoverRun run = testing::hovering(scene, seed);
  run.camera.cov = Eigen::MatrixXd::Identity(10, 10) * 1e-12;
  LocalizeConfig config;
  config.target.points = run.target;
  return localize(run.frames, run.camera, config);
}

/// A board that hangs on a thread, or warps: by 3° in ten seconds about any of its axes. Its points then fit a path
/// that is 7σ off, and innovations stay as large as they should be.
TEST(GivenCauses, ATargetThatRotatesIsNamedWithItsRate) {
  const double rate_rad_s = 3.0 / 10.0 * std::numbers::pi / 180.0;
  for (int axis = 0; axis < 3; ++axis) {
    testing::Hover scene;
    scene.num_others = 30;
    scene.target_turn_rad_s = rate_rad_s * Eigen::Vector3d::Unit(axis);
    const Localization result = of(scene, 5);
    EXPECT_NE(result.verdict.state, State::good) << axis;
    EXPECT_NE(result.verdict.sentence.find("the target rotates against the other points"), std::string::npos)
        << axis << ": " << result.verdict.sentence;
    for (const GivenNumber& given : result.given)
      if (given.name == "rotation of the target" && std::abs(given.z) > 10.0) {
        EXPECT_NEAR(std::abs(given.asked), rate_rad_s, 0.4 * rate_rad_s) << axis;  // at one linearisation
      }
  }
}

/// Of a target that stands still nothing is asked: the scores are as large as chance.
TEST(GivenCauses, ATargetThatStandsIsNot) {
  double sum = 0.0, num = 0.0;
  const auto num_seeds = static_cast<std::uint64_t>(testing::trials(2));
  for (std::uint64_t seed = 1; seed <= num_seeds; ++seed) {
    testing::Hover scene;
    scene.num_others = 30;
    const Localization result = of(scene, seed);
    EXPECT_EQ(result.verdict.state, State::good) << result.verdict.sentence;
    for (const GivenNumber& given : result.given)
      if (given.name == "rotation of the target") {
        sum += given.z * given.z;
        num += 1.0;
        EXPECT_LT(std::abs(given.z), 3.5) << seed;
      }
  }
  EXPECT_EQ(num, 3.0 * static_cast<double>(num_seeds));
  RecordProperty("z_rms", std::to_string(std::sqrt(sum / num)));
  EXPECT_LT(sum / num, 1.0 + 3.0 * std::sqrt(2.0 / num));
}

}  // namespace
}  // namespace alidade
