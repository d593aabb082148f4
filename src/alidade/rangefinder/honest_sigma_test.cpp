#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "alidade/testing/rangefinder_sample.h"

// Does the stated σ hold: simulated logs, as the model says and with errors that a shot's measurements share.

namespace alidade {
namespace {

using namespace testing;
using SigmaMethod = RangefinderMethod;

struct Coverage {
  double within1 = 0.0, within2 = 0.0, model2 = 0.0, inflation = 0.0, effect = 0.0, shrinkage = 0.0, good = 0.0;
  int num = 0, refused = 0;
};

/// What of the world is not as the model says.
struct Deviation {
  const char* name = "none";
  double bias_px = 0.0;      ///< Of all spots of a log, alike.
  double per_shot_px = 0.0;  ///< Of corners and spots of a photo, in common.
  double lens_px = 0.0;      ///< Of the camera file's focal length and centre beyond what its covariance says.
  double bow_m = 0.0;        ///< Of the board's middle.
  bool told = true;
};

void deviate(const Deviation& deviation, std::uint64_t seed, RangefinderSample& sample) {
  Draws draws(seed + 77);
  const Eigen::Vector2d bias = deviation.bias_px * draws.normal2();
  for (std::size_t i = 0; i < sample.simulated.shots.size(); ++i) {
    Shot& shot = sample.simulated.shots[i];
    const Eigen::Vector2d common = deviation.per_shot_px * draws.normal2();
    if (shot.spot) shot.spot->px += bias + common;
    if (!shot.board || deviation.bow_m == 0.0) continue;
    const Eigen::Vector3d middle = 0.5 * (sample.points.front() + sample.points.back());
    const double corner2 = (sample.points.front() - middle).squaredNorm();
    for (Corner& corner : shot.board->corners) {
      Eigen::Vector3d point = sample.points[static_cast<std::size_t>(corner.index)];
      const auto flat = project(sample.scene.camera, sample.scene.cam_from_board[i] * point);
      point.z() += deviation.bow_m * ((point - middle).squaredNorm() / corner2 - 1.0);
      const auto bowed = project(sample.scene.camera, sample.scene.cam_from_board[i] * point);
      if (flat && bowed) corner.px += *bowed - *flat;
    }
  }
  Eigen::VectorXd values = params(sample.camera.lens);
  for (Eigen::Index i = 0; i < 4; ++i) values[i] += deviation.lens_px * draws.normal();
  sample.camera.lens = with_params(sample.camera.lens, values);
}

Coverage coverage_of(SigmaMethod method, int num_shots, int trials, const Deviation& deviation) {
  Coverage coverage;
  RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  scene.num_shots = num_shots;
  for (int trial = 0; trial < trials; ++trial) {
    const auto seed = static_cast<std::uint64_t>(900000 + 10000 * num_shots + trial);
    auto sample = draw_rangefinder_sample(scene, {}, seed);
    deviate(deviation, seed, sample);
    const RangefinderConfig config = deviation.told ? told_config(method) : RangefinderConfig{.method = method};
    const RangefinderReport report = solve_sample(sample, config);
    if (report.status != RangefinderReport::Status::converged || !(report.bound.sigma_origin_m < 0.1)) {
      ++coverage.refused;
      continue;
    }
    Eigen::Vector<double, 5> error;
    error << report.beam.origin_in_cam - sample.scene.beam.origin_in_cam, direction_error_rad(report, sample);
    ++coverage.num;
    coverage.effect += report.clusters.design_effect;
    coverage.shrinkage += report.clusters.shrinkage;
    const Verdict verdict = rangefinder_verdict(report, sample.simulated.shots, config);
    coverage.good += verdict.state == State::good ? 1.0 : 0.0;
    for (Eigen::Index i = 0; i < 5; ++i) {
      const double e = std::abs(error[i]);
      coverage.within1 += e < std::sqrt(report.beam.cov(i, i)) ? 0.2 : 0.0;
      coverage.within2 += e < 2.0 * std::sqrt(report.beam.cov(i, i)) ? 0.2 : 0.0;
      coverage.model2 += e < 2.0 * std::sqrt(report.cov_model(i, i)) ? 0.2 : 0.0;
      coverage.inflation += 0.2 * std::sqrt(report.beam.cov(i, i) / report.cov_model(i, i));
    }
  }
  for (double* value : {&coverage.within1, &coverage.within2, &coverage.model2, &coverage.inflation, &coverage.effect,
                        &coverage.shrinkage, &coverage.good})
    *value /= std::max(1, coverage.num);
  return coverage;
}

TEST(HonestSigma, Explore) {
  const char* const wanted = std::getenv("EXPLORE");
  if (!wanted) GTEST_SKIP();
  const int trials = std::atoi(wanted);
  const Deviation deviations[] = {{},
                                  {.name = "residuals", .told = false},
                                  {.name = "bias", .bias_px = 0.5},
                                  {.name = "bias-res", .bias_px = 0.5, .told = false},
                                  {.name = "pershot", .per_shot_px = 0.5},
                                  {.name = "lens", .lens_px = 4.0},
                                  {.name = "bow", .bow_m = 0.001},
                                  {.name = "bow-res", .bow_m = 0.001, .told = false}};
  for (const Deviation& deviation : deviations) {
    for (const auto method : {SigmaMethod::joint, SigmaMethod::spot, SigmaMethod::plane}) {
      for (const int n : {6, 12, 18}) {
        const Coverage c = coverage_of(method, n, trials, deviation);
        std::printf(
            "%-10s %d n=%2d  1σ %.3f 2σ %.3f (model 2σ %.3f) inflation %.2f effect %.2f shrinkage %.2f good %.2f n %d "
            "refused %d\n",
            deviation.name, static_cast<int>(method), n, c.within1, c.within2, c.model2, c.inflation, c.effect,
            c.shrinkage, c.good, c.num, c.refused);
        std::fflush(stdout);
      }
    }
  }
}

}  // namespace
}  // namespace alidade
