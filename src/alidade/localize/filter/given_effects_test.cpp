#include "alidade/localize/filter/given_effects.h"

#include <gtest/gtest.h>

#include "alidade/localize/filter/given_numbers.h"
#include "alidade/testing/hover.h"

namespace alidade {
namespace {

using testing::HoverRun;

/// The first 20 frames from the true start, gates wide open so that nothing but the numbers changes.
LocalizationFilter followed(const HoverRun& run, const Camera& camera, double scale, LocalizationFilterConfig config) {
  config.gate = 1e9;
  config.finds_consensus = false;
  config.max_iterations = 8;
  config.curvature_tolerance = 1e-9;
  CameraMotion start;
  start.world_from_cam = run.truth.front().world_from_cam;
  MotionMatrix cov = MotionMatrix::Zero();
  cov.diagonal().head<6>().setConstant(0.01);
  cov.diagonal().tail<6>().setConstant(0.1);
  LocalizationFilter filter(camera, start, cov, config);
  for (const KnownPoint& point : run.target) filter.add_known(point.id, scale * point.point_in_world, point.sigma_m);
  for (std::size_t k = 0; k < 20; ++k) {
    if (k > 0) filter.predict(1.0 / 30.0);
    filter.update(run.frames[k].observations);
    for (const FeatureObservation& observation : run.frames[k].observations)
      if (!filter.has(observation.id)) filter.add(observation.id, observation.px, {1.2, 0.3});
    if (k == 10) filter.remove(run.frames[k].observations.back().id);
    filter.convert_linear();
  }
  return filter;
}

/// Derivatives that are carried beside the state, and the same filter run with another number.
TEST(GivenEffects, TheStateMovesAsItSays) {
  const HoverRun run = testing::hovering({.num_frames = 20, .num_others = 12, .sigma_px = 0.1}, 21);
  const LocalizationFilter filter = followed(run, run.camera, 1.0, {});
  const Eigen::Matrix<double, 6, Eigen::Dynamic> J = filter.J_pose_given();
  const std::vector<int>& lens_params = filter.given().lens_params();
  ASSERT_EQ(lens_params.size(), 5u);  // fx fy cx cy k1; the scale
  const std::vector<double> steps{0.2, 0.2, 0.1, 0.1, 2e-4, 2e-4};
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const auto moved = [&](double by) {
      Camera camera = run.camera;
      Eigen::VectorXd values = params(camera.lens);
      if (i < lens_params.size()) values[lens_params[i]] += by;
      camera.lens = with_params(camera.lens, values);
      return followed(run, camera, i < lens_params.size() ? 1.0 : 1.0 + by, {}).motion().world_from_cam;
    };
    const Rigid3 low = moved(-steps[i]), high = moved(steps[i]), centre = filter.motion().world_from_cam;
    Eigen::Vector<double, 6> numeric;
    numeric << centre.rotation.conjugate() * (high.translation - low.translation),
        log_so3(low.rotation.conjugate() * high.rotation);
    numeric /= 2.0 * steps[i];
    const Eigen::Vector<double, 6> said = J.col(static_cast<Eigen::Index>(i));
    // The filter relinearises as it goes, and its gains follow: alike, not the same.
    EXPECT_LT((numeric - said).norm(), 0.1 * numeric.norm())
        << i << ": " << numeric.transpose() << "; " << said.transpose();
  }
}

/// Live, and without smoothing: a lens drawn from its file's covariance.
TEST(GivenEffects, AFilterCountsTheLens) {
  constexpr int num_seeds = 6;
  double counted = 0.0, ignored = 0.0;
  Draws draws(5);
  for (std::uint64_t seed = 1; seed <= num_seeds; ++seed) {
    const HoverRun run = testing::hovering({.num_frames = 60, .num_others = 30}, 900 + seed);
    Camera given = run.camera;
    Eigen::VectorXd values = params(given.lens), sigma = Eigen::VectorXd::Zero(values.size());
    sigma.head<4>() << 12.0, 12.0, 10.0, 10.0;
    for (Eigen::Index i = 0; i < 4; ++i) values[i] += sigma[i] * draws.normal();
    given.lens = with_params(given.lens, values);
    const auto nees = [&](const Camera& camera) {
      LocalizeConfig config;
      config.target.points = run.target;
      config.smooths = false;
      const Localization report = localize(run.frames, camera, config);
      return testing::pose_nees(report.path.back(), run.truth.back().world_from_cam) / num_seeds;
    };
    ignored += nees(given);
    given.cov = sigma.cwiseAbs2().asDiagonal();
    counted += nees(given);
  }
  EXPECT_LT(counted, 3.5);  // the filter alone has 1.9 with the right lens, and six draws scatter
  EXPECT_GT(ignored, 2.0 * counted);
}

/// Without a target as with one; and what an ordinary error would do is said.
TEST(GivenEffects, WithoutATargetWhatWasAssumedIsSaid) {
  const HoverRun run = testing::hovering({.num_frames = 60, .num_others = 30}, 4);
  const Localization report = localize(run.frames, run.camera);
  const auto assumed = report.assumed;
  const auto focal = std::ranges::find(assumed, std::string("camera.f (relative)"), &Assumption::name);
  ASSERT_NE(focal, assumed.end());
  EXPECT_FALSE(focal->sigma.has_value());
  EXPECT_GT(focal->moves, 0.0);
  Camera known = run.camera;
  known.cov = Eigen::MatrixXd::Zero(10, 10);
  known.cov(0, 0) = known.cov(1, 1) = 9.0;
  const auto counted = localize(run.frames, known).assumed;
  EXPECT_NEAR(*std::ranges::find(counted, std::string("camera.f (relative)"), &Assumption::name)->sigma, 3.0 / 610.0,
              1e-4);
}

}  // namespace
}  // namespace alidade
