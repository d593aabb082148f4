#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <random>

#include "alidade/network/moving_target.h"
#include "alidade/testing/moving_scene.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

using Placement = MovingTargetReport::Status;
using testing::MovingScene;

/// At one height.
Eigen::Vector3d level(double t_s) {
  return {12.0 * std::sin(0.37 * t_s), -6.0, 30.0 + 10.0 * std::cos(0.29 * t_s + 0.4)};
}

double mean_square_of(const MovingTargetReport& report, const MovingScene& scene) {
  double sum = 0.0;
  for (std::size_t c = 1; c < 3; ++c) {
    const auto at = static_cast<Eigen::Index>(num_head_params * c);
    const Eigen::Matrix<double, 6, 1> error = testing::error_of(report, scene, c);
    for (Eigen::Index k = 0; k < 6; ++k) sum += error[k] * error[k] / report.rig.cov(at + k, at + k) / 12.0;
  }
  return sum;
}

/// A path in a plane has a mirrored one: "the images of head 2 are mirrored", which they are not.
TEST(MovingFaults, APathInAPlaneIsNoMirroredCamera) {
  const auto num = static_cast<unsigned>(testing::trials(4));
  double mean_square = 0.0;
  for (unsigned seed = 1; seed <= num; ++seed) {
    const MovingScene scene = testing::scene_of(level, seed, false);
    const MovingTargetConfig config{.distance = testing::true_distance(scene)};
    const MovingTargetReport report = place_cameras(scene.observations, testing::unplaced(scene), config);
    ASSERT_EQ(report.status, Placement::placed) << seed;
    EXPECT_EQ(report.camera_fault, "") << seed;
    for (const LocatedCamera& camera : report.cameras) EXPECT_TRUE(camera.placed) << seed << ": " << camera.reason;
    mean_square += mean_square_of(report, scene) / num;
  }
  EXPECT_LT(mean_square, 2.0);
}

/// It was a σ of attitude that is too large, and no word of which camera, or why.
TEST(MovingFaults, AnotherClockIsNamed) {
  const auto num = static_cast<unsigned>(testing::trials(1));
  for (unsigned seed = 1; seed <= num; ++seed) {
    MovingScene scene = testing::scene_of(testing::loops, seed, false);
    const MovingTargetConfig config{.distance = testing::true_distance(scene)};
    for (TargetObservation& observation : scene.observations)
      if (observation.head == 2) observation.t_capture_s += 0.1;
    const Verdict verdict =
        moving_target_verdict(place_cameras(scene.observations, testing::unplaced(scene), config), config);
    EXPECT_NE(verdict.sentence.find("the clock of head 3 is 1"), std::string::npos) << verdict.sentence;
    EXPECT_NE(verdict.to_add.find("--clocks"), std::string::npos) << verdict.to_add;
  }
}

/// What one of three does is another's residual, too.
TEST(MovingFaults, OfFourCamerasTheOneThatMovedIsNamed) {
  MovingTargetReport report;
  report.status = Placement::placed;
  report.sigma_relative_rad = 0.02;
  report.sigma_relative_m = 0.1;
  for (int id = 1; id <= 4; ++id) {
    report.cameras.push_back({.id = id, .placed = true, .sigma_px = id == 3 ? 9.1 : 0.5});
    report.rig.heads.emplace_back();
    report.rig.heads.back().head.world_from_base.translation.x() = 20.0 * id;
  }
  EXPECT_NE(moving_target_verdict(report, {}).to_add.find("head 3 agrees to 9.1 px only"), std::string::npos)
      << moving_target_verdict(report, {}).to_add;
  report.cameras[1].placed = false;
  EXPECT_EQ(moving_target_verdict(report, {}).to_add.find("head 3 agrees"), std::string::npos);
  report.cameras[1].placed = true;
  report.cameras[2].sigma_px = 0.6;
  EXPECT_EQ(moving_target_verdict(report, {}).to_add.find("was moved"), std::string::npos);
}

/// σ of the first camera was 0 in the world of a true path that itself errs.
TEST(MovingFaults, TheTruePathsOwnErrorsAreInEveryCamerasCovariance) {
  const auto num = static_cast<unsigned>(testing::trials(6));
  double sum = 0.0;
  for (unsigned seed = 1; seed <= num; ++seed) {
    const MovingScene scene = testing::scene_of(testing::loops, seed, false);
    std::mt19937 random(100 + seed);
    std::normal_distribution<double> normal;
    TrueTrack truth;
    Eigen::Vector3d off = 0.05 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    for (double t_s = -1.0; t_s < 41.0; t_s += 0.2) {
      const double kept = std::exp(-0.2 / 1.0);  // errors of a receiver last
      off = kept * off +
            0.05 * std::sqrt(1.0 - kept * kept) * Eigen::Vector3d(normal(random), normal(random), normal(random));
      truth.t_s.push_back(t_s);
      truth.position.emplace_back(testing::loops(t_s) + off);
    }
    const MovingTargetReport report = place_cameras(scene.observations, testing::unplaced(scene), {}, truth);
    ASSERT_EQ(report.status, Placement::placed) << seed;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto at = static_cast<Eigen::Index>(num_head_params * c);
      const Rigid3 error = scene.truth[c].head.world_from_base.inverse() * report.rig.heads[c].head.world_from_base;
      Eigen::Matrix<double, 6, 1> xi;
      xi << error.translation, log_so3(error.rotation);
      for (Eigen::Index k = 0; k < 6; ++k) {
        ASSERT_GT(report.rig.cov(at + k, at + k), 0.0) << c;
        sum += xi[k] * xi[k] / report.rig.cov(at + k, at + k) / 18.0;
      }
    }
  }
  EXPECT_GT(sum / num, 0.15);
  EXPECT_LT(sum / num, 1.6);
}

/// 12 m up and down, 40 m along, 1 m across, in 20 s.
Eigen::Vector3d narrow(double t_s) {
  const auto waves = [t_s](const Eigen::Vector3d& size, const Eigen::Vector3d& rate, const Eigen::Vector3d& phase) {
    return size.dot(Eigen::Vector3d((rate.array() * t_s + phase.array()).sin()));
  };
  return {waves({4.990, 3.079, 4.219}, {0.1258, 0.2958, 0.2636}, {3.421, 1.176, 4.856}),
          -15.0 - 0.5 * waves({3.586, 3.394, 7.914}, {0.4450, 0.2648, 0.4107}, {6.262, 1.990, 1.956}),
          waves({7.732, 7.480, 5.369}, {0.4060, 0.1290, 0.2994}, {1.580, 3.805, 1.759})};
}

/// By the start of the first pair no path fit, and a clock was said to be 210 ms behind.
TEST(MovingFaults, AShortPathIsBegunByAnotherPairWhereNoneFits) {
  const std::array<Eigen::Vector3d, 3> places{Eigen::Vector3d(39.904, -1.019, 2.776),
                                              Eigen::Vector3d(-21.522, -2.651, 33.716),
                                              Eigen::Vector3d(-19.592, -3.905, -34.873)};
  for (const unsigned seed : {2U, 3U}) {
    MovingScene scene = testing::scene_of(testing::loops, seed, false);
    std::mt19937 random(seed);
    std::normal_distribution<double> noise;
    scene.observations.clear();
    for (std::size_t c = 0; c < 3; ++c) {
      scene.truth[c].head.world_from_base = testing::looking(places[c], {0.0, -15.0, 0.0});
      for (double t_s = 0.01 * static_cast<double>(c); t_s < 20.0; t_s += 0.04) {
        const auto seen = project(scene.truth[c], Eigen::Vector2d::Zero(), narrow(t_s));
        if (!seen || random() % 10 == 0) continue;
        const Eigen::Vector2d px = seen->px + Eigen::Vector2d(noise(random), noise(random));
        if (px.x() < 0.0 || px.y() < 0.0 || px.x() > 1919.0 || px.y() > 1079.0) continue;
        scene.observations.push_back({t_s, t_s, c, Eigen::Vector2d::Zero(), px, 0.0});
      }
    }
    const MovingTargetConfig config{.distance = testing::true_distance(scene)};
    const MovingTargetReport report = place_cameras(scene.observations, testing::unplaced(scene), config);
    EXPECT_EQ(report.status, Placement::placed) << seed;
    EXPECT_EQ(report.camera_fault, "") << seed;
    EXPECT_LT(mean_square_of(report, scene), 4.0) << seed;
  }
}

}  // namespace
}  // namespace alidade
