#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "alidade/localize.h"
#include "alidade/testing/hover.h"

// A camera file of another kind of lens than the one that was used.

namespace alidade {
namespace {

using testing::Hover;
using testing::hovering;
using testing::HoverLens;
using testing::HoverRun;

/// What calibrates so: everything of a lens but its kind is known well.
Camera as_kind(const char* kind, const Camera& camera) {
  Camera other = camera;
  Eigen::VectorXd values = Eigen::VectorXd::Zero(params(*make_lens(kind)).size());
  values.head<4>() = params(camera.lens).head<4>();
  other.lens = with_params(*make_lens(kind), values);
  other.cov = Eigen::MatrixXd::Identity(values.size(), values.size()) * 1e-6;
  other.cov.diagonal().head<4>().setConstant(1.0);
  return other;
}

Camera sure(Camera camera, double focal = 1.0) {
  Eigen::VectorXd values = params(camera.lens);
  values.head<2>() *= focal;
  camera.lens = with_params(camera.lens, values);
  camera.cov = Eigen::MatrixXd::Identity(values.size(), values.size()) * 1e-6;
  camera.cov.diagonal().head<4>().setConstant(1.0);
  return camera;
}

Localization located(const HoverRun& run, const Camera& camera) {
  LocalizeConfig config;
  config.target.points = run.target;
  return localize(run.frames, camera, config);
}

HoverRun brief_run(HoverLens lens, std::uint64_t seed, double mismatches = 0.0, int num_frames = 60) {
  Hover scene;
  scene.mismatches = mismatches;
  scene.lens = lens;
  scene.num_frames = num_frames;
  scene.num_others = 40;
  return hovering(scene, seed);
}

bool names(const Localization& result, const std::string& what) {
  return result.verdict.sentence.find(what) != std::string::npos;
}

TEST(LensKind, AnotherKindForAFisheyeIsNamed) {
  const HoverRun run = brief_run(HoverLens::fisheye, 1);
  for (const char* kind : {"pinhole", "brown"}) {
    const Localization result = located(run, as_kind(kind, run.camera));
    EXPECT_GE(result.verdict.state, State::bad);
    EXPECT_TRUE(names(result, ": a fisheye (kannala_brandt) of focal length 29")) << result.verdict.sentence;
    EXPECT_TRUE(names(result, "calibrate with --model kannala_brandt")) << result.verdict.sentence;
  }
}

TEST(LensKind, APinholeForALensThatDistortsIsNamed) {
  const HoverRun run = brief_run(HoverLens::brown, 2);
  const Localization result = located(run, as_kind("pinhole", run.camera));
  EXPECT_GE(result.verdict.state, State::bad);
  EXPECT_TRUE(names(result, "the lens is not a pinhole")) << result.verdict.sentence;
}

/// Mismatches alone are nothing to try other kinds for; beside what another kind leaves they hide none.
TEST(LensKind, AnotherKindIsNamedAmongMismatches) {
  const HoverRun run = brief_run(HoverLens::fisheye, 1, 0.1);
  const Localization result = located(run, as_kind("pinhole", run.camera));
  EXPECT_GE(result.verdict.state, State::bad);
  EXPECT_TRUE(names(result, "calibrate with --model kannala_brandt")) << result.verdict.sentence;
}

/// Another setting of the same lens is not another kind.
TEST(LensKind, TheRightKindIsNotDoubted) {
  for (const HoverLens lens : {HoverLens::brown, HoverLens::fisheye}) {
    const HoverRun run = brief_run(lens, 3);
    const Localization plain = located(run, as_kind(std::string(model_name(run.camera.lens)).c_str(), run.camera));
    EXPECT_FALSE(names(plain, "calibrate with --model")) << static_cast<int>(lens) << ": " << plain.verdict.sentence;
    for (const double focal : {1.05, 1.34}) {
      const Localization result = located(run, sure(run.camera, focal));
      EXPECT_FALSE(names(result, "calibrate with --model"))
          << static_cast<int>(lens) << ", " << focal << ": " << result.verdict.sentence;
    }
  }
}

constexpr int focal_frames = 90;  // that many determine a focal length

/// Of everything but the focal length, and a path with that: the estimate is what it was, within σ.
TEST(LensKind, AWrongFocalLengthIsEstimatedAndNamed) {
  for (const HoverLens lens : {HoverLens::brown, HoverLens::fisheye}) {
    for (const double focal : {0.75, 1.34}) {
      const HoverRun run = brief_run(lens, 4, 0.0, focal_frames);
      const Localization result = located(run, sure(run.camera, focal));
      const std::string what = (lens == HoverLens::brown ? "Brown, " : "fisheye, ") + std::to_string(focal);
      ASSERT_TRUE(result.given_camera) << what << ": " << result.verdict.sentence;
      EXPECT_TRUE(names(result, focal < 1.0 ? "focal length +3" : "focal length -2"))
          << what << ": " << result.verdict.sentence;
      const double estimated = params(result.camera.lens)[0], sigma = result.sigma_lens[0];
      EXPECT_LT(std::abs(estimated - params(run.camera.lens)[0]), 4.0 * sigma) << what;
      EXPECT_LT(sigma, 0.02 * estimated) << what;
      EXPECT_LT(20 * result.num_gated, result.num_used) << what;
      double nees = 0.0;
      for (std::size_t k = 0; k < run.truth.size(); ++k)
        nees += testing::pose_nees(result.path[k], run.truth[k].world_from_cam) / static_cast<double>(run.truth.size());
      EXPECT_LT(nees, 3.0) << what;  // errors of neighbouring frames are nearly one
    }
  }
}

/// A focal length as wrong as its covariance says is counted, and contradicts nothing.
TEST(LensKind, AFocalLengthWithinItsSigmaIsLeft) {
  const HoverRun run = brief_run(HoverLens::brown, 5, 0.0, focal_frames);
  Camera camera = sure(run.camera, 1.03);
  camera.cov.diagonal().head<2>().setConstant(std::pow(0.03 * params(camera.lens)[0], 2));
  EXPECT_FALSE(located(run, camera).given_camera);
  camera.cov.diagonal().head<2>().setConstant(0.01);
  EXPECT_TRUE(located(run, camera).given_camera);
}

}  // namespace
}  // namespace alidade
