#include <gtest/gtest.h>

#include "alidade/geometry/so3.h"
#include "alidade/localize.h"
#include "alidade/simulate/draws.h"
#include "alidade/testing/hover.h"
#include "alidade/testing/trials.h"

// Stills of a target: the camera comes from one to the next by no motion that a filter would expect.

namespace alidade {
namespace {

struct Stills {
  std::vector<ObservationFrame> frames;
  std::vector<TimedPose> truth;
};

Rigid3 looking_at_the_centre(Draws& draws) {
  const Eigen::Vector3d place(draws.uniform(-0.4, 0.4), draws.uniform(-0.3, 0.3), draws.uniform(-0.8, -0.45));
  const Eigen::Quaterniond towards = rotation_between(Eigen::Vector3d::UnitZ(), -place);
  return {
      towards * exp_so3(Eigen::Vector3d(draws.uniform(-0.1, 0.1), draws.uniform(-0.1, 0.1), draws.uniform(-1.0, 1.0))),
      place};
}

Stills stills(const Camera& camera, std::span<const Eigen::Vector3d> points, int num, double dt_s, std::uint64_t seed) {
  Draws draws(seed);
  Stills all;
  const Eigen::VectorXd p = params(camera.lens);
  for (int k = 0; k < num;) {
    const Rigid3 world_from_cam = looking_at_the_centre(draws);
    ObservationFrame frame{k, k * dt_s, {}};
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto px = testing::hover::seen(testing::HoverLens::brown, p, world_from_cam.inverse() * points[i]);
      if (px) frame.observations.push_back({static_cast<long>(i), *px + 0.3 * draws.normal2(), 0.0});
    }
    if (frame.observations.size() < points.size()) continue;
    all.frames.push_back(std::move(frame));
    all.truth.push_back({k++ * dt_s, world_from_cam});
  }
  return all;
}

/// Four given corners in each, and with them forty that are not given; once a second, and as fast as a film's.
TEST(Stills, EachIsWhereItsTargetSays) {
  Camera camera = testing::hover::camera_of(testing::HoverLens::brown);
  const std::vector<Eigen::Vector3d> corners{
      {-0.105, -0.075, 0.0}, {0.105, -0.075, 0.0}, {0.105, 0.075, 0.0}, {-0.105, 0.075, 0.0}};
  for (const int num_others : {0, 40}) {
    for (const double dt_s : {1.0, 1.0 / 30.0}) {
      for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(1)); ++seed) {
        std::vector<Eigen::Vector3d> points = corners;
        Draws draws(50 + seed);
        for (int i = 0; i < num_others; ++i)
          points.emplace_back(draws.uniform(-0.1, 0.1), draws.uniform(-0.07, 0.07), 0.0);
        const Stills run = stills(camera, points, 22, dt_s, seed);
        LocalizeConfig config;
        for (std::size_t i = 0; i < corners.size(); ++i)
          config.target.points.push_back({static_cast<long>(i), corners[i], 0.0005});
        const Localization result = localize(run.frames, camera, config, run.truth);
        const std::string which =
            std::to_string(num_others) + " others, " + std::to_string(dt_s) + " s, " + std::to_string(seed);
        EXPECT_EQ(result.num_lost, 0u) << which;
        // As a pose from four corners. Two stills in a row that are near each other look like a motion, and points that
        // were first seen from there are believed: not as good, and named.
        const bool looks_like_film = num_others > 0 && dt_s < 0.1;
        EXPECT_LT(result.error.unaligned_m, looks_like_film ? 0.03 : 0.012) << which << result.verdict.sentence;
        EXPECT_TRUE(result.verdict.ok()) << which << result.verdict.sentence;
      }
    }
  }
}

TEST(Stills, PointsOnALineUpToTheirSigmaAreRefused) {
  const Camera camera = testing::hover::camera_of(testing::HoverLens::brown);
  Draws draws(8);
  std::vector<Eigen::Vector3d> points;
  LocalizeConfig config;
  for (int i = 0; i < 6; ++i) {
    points.push_back(Eigen::Vector3d(-0.15 + 0.06 * i, 0.0, 0.0) + 0.001 * draws.normal3());
    config.target.points.push_back({i, points.back(), 0.001});
  }
  const Stills run = stills(camera, points, 22, 1.0, 3);
  const Verdict verdict = localize(run.frames, camera, config).verdict;
  EXPECT_EQ(verdict.exit_code, ExitCode::undetermined) << verdict.sentence;
  EXPECT_NE(verdict.sentence.find("not on a line"), std::string::npos) << verdict.sentence;
}

}  // namespace
}  // namespace alidade
