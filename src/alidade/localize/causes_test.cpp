#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "alidade/testing/hover.h"

// What is not as told: no path that is called good is further from the truth than five of its σ, and the cause is
// named.

namespace alidade {
namespace {

using testing::Hover;
using testing::HoverRun;

struct CauseRuns {
  int num_good = 0, num_silent = 0, num_named = 0;
  double worst_z = 0.0;
};

double worst_of(const LocalizeReport& report, const HoverRun& run) {
  double worst = 0.0;
  for (std::size_t k = 0; k < report.path.size(); ++k) {
    const PathStep& step = report.path[k];
    if (!step.has_pose()) continue;
    const Rigid3 error = step.world_from_cam.inverse() * run.truth[k].world_from_cam;
    Eigen::Vector<double, 6> e;
    e << error.translation, log_so3(error.rotation);
    worst = std::max(worst, e.cwiseQuotient(step.cov.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff());
  }
  return worst;
}

constexpr int num_draws = 20;

/// `named`: what the sentence of a verdict that is not good has to hold.
CauseRuns runs_of(Hover scene, std::uint64_t first_seed, const std::string& named,
                  const std::function<void(Eigen::VectorXd&)>& mistell = {}) {
  scene.num_frames = 90;
  scene.num_others = 30;
  CauseRuns runs;
  for (std::uint64_t seed = first_seed; seed < first_seed + num_draws; ++seed) {
    const HoverRun run = testing::hovering(scene, seed);
    Camera told = run.camera;
    Eigen::VectorXd values = params(told.lens);
    if (mistell) mistell(values);
    told.lens = with_params(told.lens, values);
    told.cov = Eigen::MatrixXd::Zero(values.size(), values.size());
    LocalizeConfig config;
    config.target = run.target;
    const LocalizeReport report = localize_sights(told, run.frames, config);
    const Verdict verdict = localize_verdict(report);
    const double worst = worst_of(report, run);
    const bool is_good = verdict.state == State::good;
    runs.num_good += is_good ? 1 : 0;
    runs.num_silent += is_good && worst > 5.0 ? 1 : 0;
    runs.num_named += verdict.sentence.find(named) != std::string::npos ? 1 : 0;
    runs.worst_z = std::max(runs.worst_z, worst);
  }
  return runs;
}

TEST(Causes, AllToldRightIsGood) {
  const CauseRuns runs = runs_of({}, 3000, "");
  EXPECT_GE(runs.num_good, 19);
  EXPECT_LT(runs.worst_z, 5.0);
}

TEST(Causes, AWrongFocalLengthIsNamed) {
  for (const double factor : {1.05, 0.98}) {
    const CauseRuns runs =
        runs_of({}, 3100, "focal length", [&](auto& values) { values.template head<2>() *= factor; });
    EXPECT_EQ(runs.num_silent, 0) << factor;
    EXPECT_EQ(runs.num_good, 0) << factor;
    EXPECT_GE(runs.num_named, 15) << factor;
  }
}

TEST(Causes, AWrongCentreAndAMissingK1AreNamed) {
  const CauseRuns centre = runs_of({}, 3200, "centre u", [](auto& values) { values[2] += 25.0; });
  EXPECT_EQ(centre.num_good, 0);
  EXPECT_GE(centre.num_named, 15);
  const CauseRuns k1 = runs_of({}, 3300, "", [](auto& values) { values[5] = 0.0; });
  EXPECT_EQ(k1.num_good, 0);
}

TEST(Causes, ATargetThatMovesIsNamed) {
  const CauseRuns runs = runs_of({.target_speed_m_s = 0.01}, 3400, "the target moves");
  EXPECT_EQ(runs.num_good, 0);
  EXPECT_GE(runs.num_named, 15);
}

TEST(Causes, ARollingShutterIsNamed) {
  const CauseRuns runs = runs_of({.readout_s = 0.03}, 3500, "rolling shutter");
  EXPECT_EQ(runs.num_silent, 0);
  EXPECT_LE(runs.num_good, 1);  // a camera that hardly turns while its speed is aside
  EXPECT_GE(runs.num_named, 15);
}

TEST(Causes, ATargetOfAnotherShapeIsNamed) {
  const CauseRuns runs = runs_of({.target_stretch = 0.04}, 3600, "longer along x");
  EXPECT_EQ(runs.num_silent, 0);
  EXPECT_EQ(runs.num_good, 0);
}

/// From one place a flat target hardly tells how it is tilted.
TEST(Causes, ACameraThatTurnsInPlaceIsHonest) {
  const CauseRuns runs = runs_of({.turns_in_place = true}, 3700, "");
  EXPECT_EQ(runs.num_silent, 0);
}

/// Six known points, four in ten sights of all elsewhere: the path is that of the others.
TEST(Causes, MismatchesAreLeftOut) {
  const CauseRuns runs = runs_of({.mismatches = 0.4}, 3800, "");
  EXPECT_EQ(runs.num_silent, 0);
  EXPECT_LT(runs.worst_z, 6.0);
}

}  // namespace
}  // namespace alidade
