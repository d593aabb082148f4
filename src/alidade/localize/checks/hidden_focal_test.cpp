#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/geometry/so3.h"
#include "alidade/localize.h"
#include "alidade/testing/hover.h"
#include "alidade/testing/trials.h"

// A focal length that is not of this lens as it was used, and of which few or noisy points say little.

namespace alidade {
namespace {

struct Outcome {
  Localization result;
  double most_sigmas = 0.0;  ///< Of any number of any pose.
};

Outcome told(double f, int num_others, double sigma_px, bool is_px_given, std::uint64_t seed) {
  testing::HoverRun run = testing::hovering({.num_frames = 100, .num_others = num_others, .sigma_px = sigma_px}, seed);
  Eigen::VectorXd lens = params(run.camera.lens), sigma = Eigen::VectorXd::Zero(10);
  lens.head<2>() *= f;
  sigma.head<4>().setConstant(0.3);
  run.camera.lens = with_params(run.camera.lens, lens);
  run.camera.cov = sigma.cwiseAbs2().asDiagonal();
  LocalizeConfig config;
  config.target.points = run.target;
  config.sigma_times_s = 0.0;
  config.sigma_scale = 0.001;
  if (is_px_given) config.sigma_px = sigma_px;
  Outcome outcome{localize(run.frames, run.camera, config)};
  for (std::size_t k = 0; k < run.truth.size(); ++k) {
    const PathStep& step = outcome.result.path[k];
    const Rigid3 by = step.world_from_cam.inverse() * run.truth[k].world_from_cam;
    Eigen::Vector<double, 6> off;
    off << by.translation, log_so3(by.rotation);
    outcome.most_sigmas =
        std::max(outcome.most_sigmas, (off.array().abs() / step.cov.diagonal().array().sqrt()).maxCoeff());
  }
  return outcome;
}

/// 3 % off, 2 px: ● 8 to 10σ off in most of these, σ of a pixel given or not.
TEST(HiddenFocal, IsNamedOrInSigma) {
  const auto num = static_cast<std::uint64_t>(testing::trials(2));
  for (const int num_others : {0, 6})
    for (const bool is_px_given : {false, true})
      for (std::uint64_t seed = 1; seed <= num; ++seed) {
        const Outcome outcome = told(1.03, num_others, 2.0, is_px_given, seed);
        if (outcome.result.verdict.state == State::good)
          EXPECT_LT(outcome.most_sigmas, 5.0) << num_others << " " << seed;
      }
}

/// What is counted is said with what is assumed; and of a right lens the path stays good, within σ.
TEST(HiddenFocal, OfARightLensIsSaid) {
  const auto num = static_cast<std::uint64_t>(testing::trials(2));
  for (std::uint64_t seed = 1; seed <= num; ++seed) {
    const Outcome outcome = told(1.0, 0, 2.0, true, seed);
    EXPECT_EQ(outcome.result.verdict.state, State::good) << outcome.result.verdict.sentence;
    EXPECT_LT(outcome.most_sigmas, 5.0);
    const auto row = std::ranges::find(outcome.result.assumed, "camera.f (relative)", &Assumption::name);
    ASSERT_NE(row, outcome.result.assumed.end());
    EXPECT_GT(row->sigma.value_or(0.0), 0.003) << "the file's is 0.0005";
    EXPECT_LE(row->moves, 1.0);
    EXPECT_TRUE(std::ranges::any_of(outcome.result.verdict.checks,
                                    [](const Check& check) { return check.name == "focal length"; }));
  }
}

/// Where the observations tell it to 0.3 %, σ is what it was.
TEST(HiddenFocal, OfManyPointsIsNothing) {
  const Outcome outcome = told(1.0, 60, 0.5, true, 1);
  const auto focal = std::ranges::find(outcome.result.given, "focal length", &GivenNumber::name);
  ASSERT_NE(focal, outcome.result.given.end());
  EXPECT_LT(focal->hidden, 0.012);
  EXPECT_LT(std::hypot(1.0, focal->moves * focal->sigma_hidden), 1.2);
}

}  // namespace
}  // namespace alidade
