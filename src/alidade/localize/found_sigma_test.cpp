#include <gtest/gtest.h>

#include <string>

#include "alidade/localize.h"
#include "alidade/testing/hover.h"
#include "alidade/testing/trials.h"

// σ of a pixel that nobody gave.

namespace alidade {
namespace {

using testing::Hover;
using testing::hovering;
using testing::HoverRun;

LocalizeConfig target_of(const HoverRun& run) {
  LocalizeConfig config;
  config.target.points = run.target;
  config.sigma_times_s = 0.0;
  config.sigma_scale = 0.001;
  return config;
}

Localization with_found_sigma(const HoverRun& run, std::optional<double> sigma_px = {}) {
  LocalizeConfig config = target_of(run);
  config.sigma_px = sigma_px;
  return localize(run.frames, run.camera, config, run.truth);
}

Hover noisy(double sigma_px) { return {.num_frames = 100, .num_others = 25, .sigma_px = sigma_px}; }

TEST(FoundSigma, IsTakenWhereItIsNotTheUsual) {
  for (const double sigma_px : {0.1, 0.2, 1.0, 2.0, 4.0}) {
    double nees = 0.0;
    const int draws = testing::trials(2);
    for (int seed = 1; seed <= draws; ++seed) {
      const HoverRun run = hovering(noisy(sigma_px), static_cast<std::uint64_t>(seed));
      const Localization result = with_found_sigma(run);
      EXPECT_EQ(result.sigma_px_from, SigmaPxFrom::residuals) << sigma_px << " px, seed " << seed;
      EXPECT_NEAR(result.sigma_px, sigma_px, 0.12 * sigma_px) << seed;
      EXPECT_GT(result.nis_per_dof, 0.7);
      EXPECT_LT(result.nis_per_dof, 1.5) << sigma_px << " px, seed " << seed << ", found " << result.sigma_px;
      nees += result.error.nees_per_dof / draws;
      const Localization as_given = with_found_sigma(run, result.sigma_px);
      EXPECT_EQ(as_given.sigma_px_from, SigmaPxFrom::given);
      EXPECT_EQ(as_given.verdict.sentence, result.verdict.sentence);
      EXPECT_EQ(as_given.path.back().cov, result.path.back().cov);
    }
    EXPECT_GT(nees, 0.2) << sigma_px;  // what is counted of the lens is not drawn
    EXPECT_LT(nees, 1.5) << sigma_px;
  }
}

TEST(FoundSigma, TheUsualStaysWhereNothingDeniesItOrItIsGiven) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const Localization usual = with_found_sigma(hovering(noisy(0.5), seed));
    EXPECT_EQ(usual.sigma_px, 0.5);
    EXPECT_EQ(usual.sigma_px_from, SigmaPxFrom::usual);
  }
  HoverRun run = hovering(noisy(2.0), 1);
  run.frames.resize(30);
  run.truth.resize(30);
  EXPECT_EQ(with_found_sigma(run, 1.5).sigma_px, 1.5);
  for (ObservationFrame& frame : run.frames)
    for (FeatureObservation& each : frame.observations) each.sigma_px = 2.0;
  EXPECT_EQ(with_found_sigma(run).sigma_px_from, SigmaPxFrom::rows);
}

/// Errors that last are in no difference of few frames: their white part would be a third of them.
TEST(FoundSigma, ErrorsThatLastAreNotTakenForLess) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    Hover scene = noisy(0.5);
    scene.lasting = 0.9;
    const Localization result = with_found_sigma(hovering(scene, seed));
    EXPECT_EQ(result.sigma_px_from, SigmaPxFrom::usual) << seed;
    EXPECT_LT(result.error.nees_per_dof, 2.0) << seed;
  }
}

/// A focal length that is 3 % off moves no pixel from frame to frame as noise does: it is named as with the σ given.
TEST(FoundSigma, HidesNoWrongLens) {
  for (const double sigma_px : {0.5, 2.0})
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      HoverRun run = hovering(noisy(sigma_px), seed);
      Eigen::VectorXd values = params(run.camera.lens);
      values.head<2>() *= 1.03;
      run.camera.lens = with_params(run.camera.lens, values);
      const Localization result = with_found_sigma(run), as_given = with_found_sigma(run, sigma_px);
      EXPECT_NEAR(result.sigma_px, sigma_px, 0.12 * sigma_px) << seed;
      EXPECT_EQ(result.verdict.state, as_given.verdict.state) << result.verdict.sentence;
      if (sigma_px < 1.0) EXPECT_NE(result.verdict.state, State::good) << result.verdict.sentence;
    }
}

TEST(FoundSigma, FrameByFrameIsTheSameAtTheEnd) {
  for (const double sigma_px : {0.2, 0.5, 2.0}) {
    const HoverRun run = hovering(noisy(sigma_px), 2);
    LocalizeConfig config = target_of(run);
    Localizer localizer(run.camera, config);
    for (const ObservationFrame& frame : run.frames) localizer.push(frame);
    const Localization at_end = localizer.finish(run.truth), at_once = with_found_sigma(run);
    EXPECT_EQ(at_end.sigma_px, at_once.sigma_px);
    EXPECT_EQ(at_end.sigma_px_from, at_once.sigma_px_from);
    EXPECT_EQ(at_end.verdict.sentence, at_once.verdict.sentence);
    EXPECT_EQ(at_end.path.back().cov, at_once.path.back().cov);
    if (sigma_px > 0.5) continue;
    config.max_smoothed = 50;  // of a longer recording it is not sought
    Localizer longer(run.camera, config);
    for (const ObservationFrame& frame : run.frames) longer.push(frame);
    EXPECT_EQ(longer.finish().sigma_px, 0.5);
  }
}

}  // namespace
}  // namespace alidade
