#include <gtest/gtest.h>

#include <Eigen/Dense>
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
TEST(MovingFaults, AClockOrACameraThatMovedIsNamed) {
  const auto num = static_cast<unsigned>(testing::trials(1));
  for (unsigned seed = 1; seed <= num; ++seed) {
    const MovingScene scene = testing::scene_of(testing::loops, seed, false);
    const MovingTargetConfig config{.distance = testing::true_distance(scene)};
    MovingScene late = scene;
    for (TargetObservation& observation : late.observations)
      if (observation.head == 2) observation.t_capture_s += 0.1;
    const Verdict of_clock =
        moving_target_verdict(place_cameras(late.observations, testing::unplaced(scene), config), config);
    EXPECT_NE(of_clock.sentence.find("the clock of head 3 is 1"), std::string::npos) << of_clock.sentence;
    EXPECT_NE(of_clock.to_add.find("--clocks"), std::string::npos) << of_clock.to_add;
    MovingScene moved = scene;
    for (TargetObservation& observation : moved.observations)
      if (observation.head == 1 && observation.t_capture_s > 20.0) observation.px += Eigen::Vector2d(20.0, -9.0);
    const Verdict of_move =
        moving_target_verdict(place_cameras(moved.observations, testing::unplaced(scene), config), config);
    EXPECT_GE(of_move.state, State::care);
    EXPECT_NE((of_move.sentence + of_move.to_add).find("head 2"), std::string::npos)
        << of_move.sentence << " " << of_move.to_add;
  }
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

}  // namespace
}  // namespace alidade
