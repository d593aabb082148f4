#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "alidade/testing/calibration_sample.h"

// Priors and held values that the photos contradict, and those that they do not.

namespace alidade {
namespace {

using ::testing::HasSubstr;

double true_value(const std::string& name) {
  const Camera camera = testing::sample_camera("brown");
  const auto names = param_names(camera.lens);
  return params(camera.lens)[std::ranges::find(names, name) - names.begin()];
}

Calibration calibrated(std::uint64_t seed, const CalibrateConfig& config) {
  const BoardScene scene = testing::covered_scene(testing::sample_camera("brown"), 20, seed);
  return testing::sample_calibration(testing::sample_views(scene, seed), config);
}

/// The largest error of the estimated parameters in units of their σ.
double worst_sigmas(const Calibration& result) {
  const Eigen::VectorXd error = params(result.camera.lens) - params(testing::sample_camera("brown").lens);
  double worst = 0.0;
  for (Eigen::Index i = 0; i < error.size(); ++i)
    if (result.camera.cov(i, i) > 0.0) worst = std::max(worst, std::abs(error[i]) / std::sqrt(result.camera.cov(i, i)));
  return worst;
}

bool has_check(const Verdict& verdict, const std::string& name) {
  return std::ranges::find(verdict.checks, name, &Check::name) != verdict.checks.end();
}

TEST(GivenValues, APriorThatThePhotosContradictIsNamedAndCounted) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    CalibrateConfig config;
    config.priors = {{"fx", true_value("fx") + 4.0, 0.2}, {"fy", true_value("fy") + 4.0, 0.2}};
    for (const std::vector<std::string>& fixed : {std::vector<std::string>{"skew"}, std::vector<std::string>{}}) {
      config.fixed = fixed;
      const Calibration result = calibrated(seed, config);
      EXPECT_EQ(result.verdict.state, State::care);
      EXPECT_THAT(result.verdict.sentence, HasSubstr("is given as"));
      EXPECT_THAT(result.verdict.to_add, ::testing::StartsWith("correct the --prior of f"));
      EXPECT_EQ(testing::check_named(result.verdict, "lens adequate").state, State::good);
      EXPECT_LT(worst_sigmas(result), 3.5) << seed;
    }
  }
}

TEST(GivenValues, AHeldCentreThatThePhotosContradictIsNamedAndCounted) {
  const Camera camera = testing::sample_camera("brown", {{"cx", 335.0}, {"cy", 230.0}});
  constexpr std::uint64_t seed = 4;
  const BoardScene scene = testing::covered_scene(camera, 20, seed);
  const Calibration result =
      testing::sample_calibration(testing::sample_views(scene, seed), {.fixed = {"skew", "cx", "cy"}});
  EXPECT_EQ(result.verdict.state, State::care);
  EXPECT_THAT(result.verdict.sentence, HasSubstr("is held at"));
  EXPECT_THAT(result.verdict.to_add, ::testing::StartsWith("do not hold c"));
  for (const Eigen::Index at : {2, 3}) {  // cx, cy
    const double error = params(result.camera.lens)[at] - params(camera.lens)[at];
    EXPECT_LT(std::abs(error), 3.5 * std::sqrt(result.camera.cov(at, at)));
  }
}

/// True priors and a board that bends: that keeps its name and its advice.
TEST(GivenValues, GoAfterWhatPhotosDisagreeOfWithoutThem) {
  constexpr std::uint64_t seed = 1;
  CalibrateConfig config;
  config.priors = {{"fx", true_value("fx"), 0.3}, {"fy", true_value("fy"), 0.3}};
  config.board_shape = BoardShape::flat;
  const BoardScene bent = testing::covered_scene(testing::sample_camera("brown"), 20, seed, 0.004);
  EXPECT_EQ(testing::sample_calibration(testing::sample_views(bent, seed), config).verdict.to_add,
            "use --board-shape bow");
}

TEST(GivenValues, TruePriorsAreGood) {
  int good = 0;
  constexpr int sets = 8;
  for (std::uint64_t seed = 11; seed < 11 + sets; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    CalibrateConfig config;
    for (const auto& [name, sigma] : {std::pair{"fx", 0.3}, std::pair{"cy", 0.3}, std::pair{"k1", 0.001}})
      config.priors.push_back({name, true_value(name) + sigma * normal(random), sigma});
    const Calibration result = calibrated(seed, config);
    good += result.verdict.state == State::good ? 1 : 0;
    EXPECT_FALSE(has_check(result.verdict, "given values")) << seed << result.verdict.sentence;
  }
  EXPECT_GE(good, sets - 1);
}

}  // namespace
}  // namespace alidade
