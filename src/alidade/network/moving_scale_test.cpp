#include "alidade/network/moving_scale.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "alidade/geometry/so3.h"
#include "alidade/network/moving_target.h"
#include "alidade/testing/moving_scene.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

using Vector9d = Eigen::Matrix<double, 9, 1>;

/// An even circle, a little up and down: turned about its axis it is the same at another time.
Eigen::Vector3d circle(double t_s) {
  return {15.0 * std::cos(0.35 * t_s), 15.0 * std::sin(0.35 * t_s), 20.0 + 0.3 * std::sin(0.21 * t_s)};
}

struct TrueMatch {
  Similarity truth_from_path{{exp_so3({0.4, -1.0, 2.0}), {100.0, -50.0, 7.0}}, 3.0};
  double offset_s = 1000.0, rate = 1.0002;
};

/// A minute of a path in a unit of its own, and a receiver's track of it: 5 mm of noise, and an error that varies
/// slowly.
PathMatch matched(const TrueMatch& world, testing::PathOf path, double slow_m, unsigned seed, double row_s = 0.2) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise;
  std::uniform_real_distribution<double> phase(0.0, 6.28);
  const auto draw = [&] { return Eigen::Vector3d(noise(random), noise(random), noise(random)); };
  const Similarity& to_truth = world.truth_from_path;
  std::vector<double> t_s;
  std::vector<Eigen::Vector3d> points;
  for (double t = 0.0; t < 60.0; t += 0.24) {
    t_s.push_back(t);
    points.emplace_back((path(t) + 0.005 * draw()) / to_truth.scale);
  }
  const Eigen::Vector3d phases(phase(random), phase(random), phase(random));
  TrueTrack truth;
  for (double t = -3.0; t < 63.0; t += row_s) {
    truth.t_s.push_back(world.offset_s + world.rate * t);
    const Eigen::Vector3d slow = slow_m * (phases.array() + t / 7.0).sin();
    truth.position.emplace_back(to_truth.b_from_a.rotation * path(t) + to_truth.b_from_a.translation + slow +
                                0.005 * draw());
  }
  return match_path(t_s, points, truth, true).value();
}

/// Truth minus estimate, as PathMatch::cov has it.
Vector9d error_of(const PathMatch& match, const TrueMatch& world) {
  const Similarity &truth = world.truth_from_path, &found = match.truth_from_path;
  const Eigen::Vector3d at =
      found.b_from_a.rotation.conjugate() * (match.middle - found.b_from_a.translation) / found.scale;
  Vector9d error;
  error.head<3>() = truth.scale * (truth.b_from_a.rotation * at) + truth.b_from_a.translation - match.middle;
  error.segment<3>(3) = log_so3(truth.b_from_a.rotation * found.b_from_a.rotation.conjugate());
  error[6] = std::log(truth.scale / found.scale);
  error[7] = world.offset_s - match.offset_s + (world.rate - match.rate) * match.middle_s;
  error[8] = world.rate - match.rate;
  return error;
}

TEST(PathMatch, SimilarityAndClockErrByTheirSigma) {
  for (const double slow_m : {0.0, 0.2}) {
    double nees = 0.0;
    constexpr unsigned draws = 20;
    for (unsigned seed = 1; seed <= draws; ++seed) {
      const TrueMatch world;
      const PathMatch match = matched(world, testing::loops, slow_m, seed);
      const Vector9d error = error_of(match, world);
      nees += error.dot(match.cov.ldlt().solve(error)) / draws;
      for (Eigen::Index k = 0; k < 9; ++k)
        EXPECT_LT(std::abs(error[k]), 5.0 * std::sqrt(match.cov(k, k))) << slow_m << ' ' << seed << ' ' << k;
    }
    RecordProperty(slow_m > 0.0 ? "nees_slow" : "nees", std::to_string(nees));
    EXPECT_LT(nees, 18.0) << slow_m;  // of nine
  }
}

TEST(PathMatch, ACircleSaysThatItsTurnAndItsClockAreOne) {
  const TrueMatch world;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const PathMatch match = matched(world, circle, 0.0, seed);
    const Vector9d error = error_of(match, world);
    for (Eigen::Index k = 0; k < 9; ++k)
      EXPECT_LT(std::abs(error[k]), 5.0 * std::sqrt(match.cov(k, k))) << seed << ' ' << k;
    const Eigen::Vector3d axis = world.truth_from_path.b_from_a.rotation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d across = world.truth_from_path.b_from_a.rotation * Eigen::Vector3d::UnitX();
    const auto sigma = [&](const Eigen::Vector3d& about) {
      return std::sqrt(about.dot(match.cov.block<3, 3>(3, 3) * about));
    };
    EXPECT_GT(sigma(axis), 10.0 * sigma(across));
  }
}

/// Positions once a second were joined by straight lines: the path was too small by what lies inside of its bends.
TEST(PathMatch, BetweenRowsThatAreASecondApartThePathIsACurve) {
  const TrueMatch world;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const PathMatch match = matched(world, testing::loops, 0.0, seed, 1.0);
    const Vector9d error = error_of(match, world);
    for (Eigen::Index k = 0; k < 9; ++k)
      EXPECT_LT(std::abs(error[k]), 5.0 * std::sqrt(match.cov(k, k))) << seed << ' ' << k;
    EXPECT_LT(std::abs(error[6]), 1e-3) << seed;
  }
}

/// Cameras of one clock, which the true path's is taken for: they moved by 1.2 m, 6σ, in ●.
TEST(PathMatch, ATruePathThatIsLateIsNamed) {
  for (const double late_s : {0.0, 0.02, 0.1}) {
    for (unsigned seed = 1; seed <= 2; ++seed) {
      const testing::MovingScene scene = testing::scene_of(testing::loops, seed, false);
      TrueTrack truth;
      for (double t_s = -1.0; t_s < 41.0; t_s += 0.2) {
        truth.t_s.push_back(t_s + late_s);
        truth.position.emplace_back(testing::loops(t_s));
      }
      const MovingTargetReport report = place_cameras(scene.observations, testing::unplaced(scene), {}, truth);
      ASSERT_EQ(report.status, MovingTargetReport::Status::placed);
      const Verdict verdict = moving_target_verdict(report, {});
      EXPECT_NEAR(report.truth_late_s, late_s, std::max(0.002, 4.0 * report.sigma_truth_late_s));
      if (late_s == 0.0) EXPECT_EQ(verdict.state, State::good) << verdict.to_add;
      if (late_s > 0.05) EXPECT_NE(verdict.to_add.find("s late, by"), std::string::npos) << verdict.to_add;
      for (std::size_t c = 0; c < 3 && verdict.state == State::good; ++c) {
        const Rigid3& base = report.rig.heads[c].head.world_from_base;
        const Eigen::Vector3d error =
            base.rotation.conjugate() * (base.translation - scene.truth[c].head.world_from_base.translation);
        const auto at = static_cast<Eigen::Index>(num_head_params * c);
        for (Eigen::Index k = 0; k < 3; ++k)
          EXPECT_LT(std::abs(error[k]), 5.0 * std::sqrt(report.rig.cov(at + k, at + k))) << late_s << ' ' << c;
      }
    }
  }
}

/// It was a rig of kilometres, at ●.
TEST(PathMatch, ATruePathInMillimetresIsNamed) {
  const testing::MovingScene scene = testing::scene_of(testing::loops, 1, false);
  TrueTrack truth;
  for (double t_s = -1.0; t_s < 41.0; t_s += 0.2) {
    truth.t_s.push_back(t_s);
    truth.position.emplace_back(1000.0 * testing::loops(t_s));
  }
  const Verdict verdict =
      moving_target_verdict(place_cameras(scene.observations, testing::unplaced(scene), {}, truth), {});
  EXPECT_EQ(verdict.state, State::care);
  EXPECT_NE(verdict.to_add.find("is the path in metres"), std::string::npos) << verdict.to_add;
}

}  // namespace
}  // namespace alidade
