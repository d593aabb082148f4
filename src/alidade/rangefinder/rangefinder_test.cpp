#include "alidade/rangefinder/rangefinder.h"

#include <gtest/gtest.h>

#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/testing/rangefinder_sample.h"

namespace alidade {
namespace {

using namespace testing;
using Method = RangefinderMethod;
using Status = RangefinderReport::Status;

struct Degenerate {
  const char* scenario;
  Method method;
  const char* reason;
};

class DegenerateBattery : public ::testing::TestWithParam<Degenerate> {};

TEST_P(DegenerateBattery, IsAlwaysRefusedByNameWithWhatElseCouldTell) {
  const auto& [scenario, method, reason] = GetParam();
  int refused = 0;
  constexpr int trials = 24;
  for (int trial = 0; trial < trials; ++trial) {
    RangefinderSceneConfig scene = *rangefinder_scenario(scenario);
    scene.num_shots = 15;
    const auto sample = draw_rangefinder_sample(scene, {}, static_cast<std::uint64_t>(300 + trial));
    RangefinderConfig config = given_config(method);
    if (trial % 2 == 1) config.sigma_spot_px.reset(), config.sigma_range_m.reset();  // a refusal needs no σ
    const RangefinderReport report = solve_sample(sample, config);
    const Verdict verdict = rangefinder_verdict(report, sample.simulated.shots, config);
    refused += verdict.exit_code == ExitCode::undetermined ? 1 : 0;
    EXPECT_NE(verdict.sentence.find(reason), std::string::npos) << trial << ": " << verdict.sentence;
    EXPECT_NE(verdict.to_add.find("--method joint"), std::string::npos) << verdict.to_add;
    EXPECT_FALSE(verdict.checks.empty());
  }
  EXPECT_EQ(refused, trials);
}

INSTANTIATE_TEST_SUITE_P(All, DegenerateBattery,
                         ::testing::Values(Degenerate{"parallel", Method::plane, "parallel boards"},
                                           Degenerate{"frontal", Method::plane, "frontal boards"},
                                           Degenerate{"equal_range", Method::plane, "equal ranges"},
                                           Degenerate{"table1", Method::plane, "equal ranges"},
                                           Degenerate{"equal_range", Method::spot, "equal ranges"},
                                           Degenerate{"short_span", Method::spot, "equal ranges"},
                                           Degenerate{"table1", Method::spot, "equal ranges"},
                                           Degenerate{"through_centre", Method::spot, "optical centre"}));

TEST(RangefinderVerdict, AcceptsWhatCanBeDetermined) {
  int accepted = 0, asked = 0;
  for (const std::string name :
       {"reference", "parallel", "frontal", "through_centre", "toed_in", "parallel_to_view", "inverse_range"}) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      RangefinderSceneConfig scene = *rangefinder_scenario(name);
      const auto sample = draw_rangefinder_sample(scene, {}, seed);
      for (const Method method : {Method::joint, Method::spot, Method::plane}) {
        const bool boards_cannot = name == "parallel" || name == "frontal";
        if (method == Method::plane && boards_cannot) continue;
        if (method == Method::spot && name == "through_centre") continue;
        const RangefinderConfig config = given_config(method);
        const Verdict verdict = rangefinder_verdict(solve_sample(sample, config), sample.simulated.shots, config);
        ++asked;
        accepted += verdict.exit_code == ExitCode::ok ? 1 : 0;
        EXPECT_TRUE(verdict.exit_code == ExitCode::ok)
            << name << seed << " " << static_cast<int>(method) << ": " << verdict.sentence;
      }
    }
  }
  EXPECT_EQ(asked, 20 * (7 + 6 + 5));
  EXPECT_EQ(accepted, asked);
}

TEST(RangefinderVerdict, IsGreenForTheReferenceWithSpotAndBoard) {
  const auto sample = draw_rangefinder_sample(*rangefinder_scenario("reference"), {}, 1);
  const RangefinderConfig config = given_config(Method::joint);
  const Verdict verdict = rangefinder_verdict(solve_sample(sample, config), sample.simulated.shots, config);
  EXPECT_TRUE(verdict.state == State::good) << verdict.to_add;
  EXPECT_TRUE(verdict.to_add.empty());
}

TEST(RangefinderVerdict, WarnsOfAShortSpanAndOfOutliers) {
  RangefinderConfig config = given_config(Method::joint);
  auto sample = draw_rangefinder_sample(*rangefinder_scenario("short_span"), {}, 3);
  Verdict verdict = rangefinder_verdict(solve_sample(sample, config), sample.simulated.shots, config);
  EXPECT_TRUE(verdict.state == State::care && verdict.exit_code == ExitCode::ok);
  sample = draw_rangefinder_sample(*rangefinder_scenario("reference"), {.outlier_share = 0.1}, 3);
  verdict = rangefinder_verdict(solve_sample(sample, config), sample.simulated.shots, config);
  EXPECT_NE(verdict.to_add.find("rejected: shot"), std::string::npos) << verdict.to_add;
}

/// Squared error over its covariance of origin, direction and scale; χ² of six.
double error2_of(const RangefinderReport& report, const RangefinderSample& sample) {
  BeamVector error;
  error << sample.scene.beam.origin_in_cam - report.beam.origin_in_cam, direction_error_rad(report, sample),
      sample.scene.beam.scale - report.beam.scale;
  return squared_mahalanobis(error, report.beam.cov);
}

TEST(RangefinderScale, IsEstimatedWithBoardsAndRefusedWithSpotsAlone) {
  RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  scene.beam.scale = 1.02;
  double sum = 0.0;
  constexpr int trials = 60;
  for (int trial = 0; trial < trials; ++trial) {
    const auto sample = draw_rangefinder_sample(scene, {}, static_cast<std::uint64_t>(trial));
    RangefinderConfig config = given_config(trial % 2 == 0 ? Method::joint : Method::plane);
    config.estimate_scale = true;
    const RangefinderReport report = solve_sample(sample, config);
    ASSERT_TRUE(report.status == Status::converged);
    sum += error2_of(report, sample);
    if (config.method == Method::joint) {
      EXPECT_NEAR(report.beam.scale, 1.02, 0.005);
    }
    for (const Assumption& assumption : rangefinder_assumptions(report))
      EXPECT_EQ(assumption.remedy.find("--scale"), std::string::npos) << assumption.name;
    config.method = Method::spot;
    const RangefinderReport alone = solve_sample(sample, config);
    EXPECT_TRUE(alone.status == Status::scale_unknown);
    const Verdict verdict = rangefinder_verdict(alone, sample.simulated.shots, config);
    EXPECT_TRUE(verdict.exit_code == ExitCode::undetermined);
    EXPECT_NE(verdict.sentence.find("scale"), std::string::npos);
  }
  EXPECT_NEAR(sum / trials, 6.0, 4.0 * std::sqrt(12.0 / trials));
}

TEST(Rangefinder, UsesEachShotForWhatItHas) {
  double sum_mixed = 0.0, sum_full = 0.0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    RangefinderSceneConfig scene = *rangefinder_scenario("reference");
    scene.max_range_m = 2.5;  // farther, a board may be taken for its mirror image, and without its spot is rejected
    auto sample = draw_rangefinder_sample(scene, {}, seed);
    for (std::size_t i = 6; i < 18; ++i) {
      if (i < 12) sample.simulated.shots[i].spot.reset();
      if (i >= 12) sample.simulated.shots[i].board.reset();
    }
    const RangefinderReport mixed = solve_sample(sample, given_config(Method::joint));
    ASSERT_TRUE(mixed.status == Status::converged);
    EXPECT_EQ(mixed.shots_used, 18);
    sample.simulated.shots.resize(6);
    const RangefinderReport full = solve_sample(sample, given_config(Method::joint));
    sum_mixed += mixed.bound.cov.topLeftCorner<3, 3>().trace();
    sum_full += full.bound.cov.topLeftCorner<3, 3>().trace();
    Eigen::Vector3d error = mixed.beam.origin_in_cam - sample.scene.beam.origin_in_cam;
    EXPECT_LT(squared_mahalanobis(error, mixed.beam.cov.topLeftCorner<3, 3>()), 31.0);  // χ²₃ at 10⁻⁶
  }
  EXPECT_LT(sum_mixed, 0.8 * sum_full);
}

TEST(Rangefinder, FindsItsOwnNoise) {
  RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  scene.num_shots = 30;
  scene.beam.noise.sigma_m = 0.01;
  double sum_m = 0.0, sum_px = 0.0, sum_corner = 0.0;
  constexpr int trials = 20;
  for (int trial = 0; trial < trials; ++trial) {
    auto sample = draw_rangefinder_sample(scene, {.sigma_corner_px = 0.1, .sigma_spot_px = 0.8},
                                          static_cast<std::uint64_t>(trial));
    sample.camera = sample.scene.camera;  // an error of the lens would show in the corners
    const RangefinderReport report = solve_sample(sample, {});
    EXPECT_TRUE(report.spot_sigma_is_estimated && report.range_sigma_is_estimated);
    sum_m += std::pow(report.beam.noise.sigma_m, 2) / trials;
    sum_px += std::pow(report.sigma_spot_px, 2) / trials;
    sum_corner += std::pow(report.sigma_corner_px, 2) / trials;
  }
  // Variances of 30 − 3 and 60 − 3 degrees of freedom, twenty times; three standard errors.
  EXPECT_NEAR(sum_m / 1e-4, 1.0, 3.0 * std::sqrt(2.0 / (27.0 * trials)));
  EXPECT_NEAR(sum_px / 0.64, 1.0, 3.0 * std::sqrt(2.0 / (57.0 * trials)));
  EXPECT_NEAR(sum_corner / 0.01, 1.0, 0.02);
}

TEST(Rangefinder, ReadsThroughEveryLens) {
  for (const char* model : {"brown", "kannala_brandt"}) {
    RangefinderSceneConfig scene = *rangefinder_scenario("toed_in");
    scene.camera = *example_camera(model, 1280, 960);
    scene.camera.cov = Eigen::MatrixXd::Zero(params(scene.camera.lens).size(), params(scene.camera.lens).size());
    scene.camera.cov.diagonal().head<4>() << 1.0, 1.0, 1.0, 1.0;
    scene.camera.cov.diagonal()[5] = 1e-6;
    double sum = 0.0;
    constexpr int trials = 40;
    for (int trial = 0; trial < trials; ++trial) {
      const auto sample = draw_rangefinder_sample(scene, {}, static_cast<std::uint64_t>(trial));
      const RangefinderReport report = solve_sample(sample, given_config(Method::joint));
      ASSERT_TRUE(report.status == Status::converged) << model << trial;
      Eigen::Vector<double, 5> error;
      error << sample.scene.beam.origin_in_cam - report.beam.origin_in_cam, direction_error_rad(report, sample);
      sum += squared_mahalanobis(error, report.beam.cov.topLeftCorner<5, 5>());
    }
    EXPECT_NEAR(sum / trials, 5.0, 4.0 * std::sqrt(10.0 / trials)) << model;
  }
}

TEST(Rangefinder, SaysWhatIsWrongWithAShotAndGoesOn) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  auto sample = draw_rangefinder_sample(*rangefinder_scenario("reference"), {}, 5);
  auto& shots = sample.simulated.shots;
  shots[0].range_m = nan;
  shots[1].range_m = 1e300;
  shots[2].range_m = 0.0;
  shots[3].range_m = -1.0;
  shots[4].spot->px.x() = nan;
  shots[5].spot->px.y() = 1e300;
  shots[6].sigma_range_m = -0.1;
  shots[7].board->corners.resize(2);
  shots[7].spot.reset();
  for (Corner& corner : shots[8].board->corners) corner.px.setConstant(nan);
  shots[8].spot.reset();
  const RangefinderReport report = solve_sample(sample, given_config(Method::joint));
  EXPECT_TRUE(report.status == Status::converged);
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_FALSE(report.shots[i].used) << i;
    EXPECT_FALSE(report.shots[i].reason.empty()) << i;
  }
  EXPECT_EQ(report.shots_used, 9);
  EXPECT_EQ(report.shots_dropped, 9);
  EXPECT_LT(origin_error_m(report, sample), 0.02);
}

TEST(Rangefinder, RefusesTooFewShotsAndNone) {
  const auto sample = draw_rangefinder_sample(*rangefinder_scenario("four_shots"), {}, 5);
  for (const Method method : {Method::spot, Method::plane, Method::joint}) {
    const RangefinderConfig config = given_config(method);
    for (const std::size_t num : {0u, 1u}) {
      const std::span<const Shot> shots(sample.simulated.shots.data(), num);
      const RangefinderReport report = calibrate_rangefinder(shots, sample.points, sample.camera, config);
      EXPECT_TRUE(report.status == Status::too_few);
      const Verdict verdict = rangefinder_verdict(report, shots, config);
      EXPECT_TRUE(verdict.exit_code == ExitCode::undetermined);
      EXPECT_NE(verdict.sentence.find("too few"), std::string::npos);
    }
  }
}

TEST(Rangefinder, DoesNotAgreeWithNonsense) {
  Draws draws(7);
  auto sample = draw_rangefinder_sample(*rangefinder_scenario("reference"), {}, 5);
  for (Shot& shot : sample.simulated.shots) {
    shot.range_m = draws.uniform(0.5, 4.0);
    shot.spot->px = {draws.uniform(0.0, 1280.0), draws.uniform(0.0, 960.0)};
  }
  for (const Method method : {Method::spot, Method::plane, Method::joint}) {
    const RangefinderConfig config = given_config(method);
    const Verdict verdict = rangefinder_verdict(solve_sample(sample, config), sample.simulated.shots, config);
    EXPECT_FALSE(verdict.exit_code == ExitCode::ok) << static_cast<int>(method) << verdict.sentence;
  }
}

TEST(Rangefinder, SameSeedSameAnswer) {
  const auto sample = draw_rangefinder_sample(*rangefinder_scenario("reference"), {.outlier_share = 0.2}, 5);
  const RangefinderReport a = solve_sample(sample, {}), b = solve_sample(sample, {});
  EXPECT_EQ(a.beam.origin_in_cam, b.beam.origin_in_cam);
  EXPECT_EQ(a.cost, b.cost);
}

}  // namespace
}  // namespace alidade
