#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/localize/path/path_error.h"
#include "alidade/localize/path/path_smoother.h"
#include "alidade/simulate/draws.h"
#include "alidade/testing/hover.h"

namespace alidade {
namespace {

using testing::HoverRun;

/// What a filter without a target may hand over: a path that is the truth's plus `aside` a frame, and points where that
/// path would have them.
SmootherProblem problem_of(const HoverRun& run, const Eigen::Vector3d& aside) {
  SmootherProblem problem;
  problem.camera = run.camera;
  problem.gauge = PathGauge::similarity;
  for (std::size_t k = 0; k < run.frames.size(); ++k) {
    Rigid3 pose = run.truth.front().world_from_cam.inverse() * run.truth[k].world_from_cam;
    pose.translation += static_cast<double>(k) * aside;
    problem.t_s.push_back(run.frames[k].t_s);
    problem.world_from_cam.push_back(pose);
    for (const FeatureObservation& observation : run.frames[k].observations) {
      const bool is_known =
          std::ranges::find(problem.points, observation.id, &SmootherPoint::id) != problem.points.end();
      problem.observations.push_back({k, observation.id, observation.px, 0.5});
      if (is_known) continue;
      SmootherPoint point;
      point.id = observation.id;
      point.point_in_world = pose * *unproject(run.camera, observation.px);
      point.first_frame = k;
      point.range = RangePrior{1.0, k == 0 ? 0.5 : 5.0};
      problem.points.push_back(point);
    }
  }
  std::ranges::sort(problem.points, {}, &SmootherPoint::id);
  return problem;
}

std::vector<TimedPose> timed(const SmootherProblem& problem, std::span<const Rigid3> world_from_cam) {
  std::vector<TimedPose> path;
  for (std::size_t k = 0; k < world_from_cam.size(); ++k) path.push_back({problem.t_s[k], world_from_cam[k]});
  return path;
}

/// A wrong path is not where the second guess begins, and what it comes to is the truth up to a similarity.
TEST(FlatStart, OwesNothingToThePathThatIsHandedOver) {
  for (const std::uint64_t seed : {31u, 32u, 33u}) {
    const HoverRun run = testing::hovering({.num_frames = 60, .num_others = 40}, seed);
    const SmootherProblem wrong = problem_of(run, {0.0, 0.02, 0.01});
    const auto flat = flat_start(wrong);
    ASSERT_TRUE(flat);
    const auto path = smoothed_path(*flat);
    ASSERT_TRUE(path) << seed;
    const PathError error = path_error(timed(*flat, path->world_from_cam), run.truth, false);
    EXPECT_LT(error.ate_m, 0.01) << seed;
    EXPECT_LT(cost_of(*path, wrong.filter.gate), 1.2 * 2.0 * static_cast<double>(wrong.observations.size()));
  }
}

/// Points far away, each seen in a few frames from nearly the same direction, and supposed to be near: no step of Gauss
/// and Newton moves them without some of them going through the camera, and some are left out. The path is solved all
/// the same. (The last one leaves out a point after its errors were found to last.)
TEST(PathSmoother, WhatNothingDeterminesDoesNotEndIt) {
  for (const std::uint64_t seed : {41u, 43u, 44u, 46u}) {
    const double lasting = seed % 2 == 0 ? 0.9 : 0.0;  // of errors from frame to frame, which the path is solved with
    const HoverRun run = testing::hovering({.num_frames = 60, .num_others = 40, .lasting = lasting}, seed);
    SmootherProblem problem = problem_of(run, Eigen::Vector3d::Zero());
    Draws draws(seed);
    constexpr std::size_t num_far = 120, num_frames = 4;
    for (std::size_t i = 0; i < num_far; ++i) {
      const std::size_t first = 2 + i * 50 / num_far;
      const Rigid3& seen_from = problem.world_from_cam[first];
      const Eigen::Vector3d ray(draws.uniform(-0.2, 0.2), draws.uniform(-0.2, 0.2), 1.0);
      const double far = std::pow(10.0, draws.uniform(2.0, 9.0)), supposed = 0.3;
      SmootherPoint point;
      point.id = static_cast<long>(100000 + i);
      point.point_in_world = seen_from * Eigen::Vector3d(supposed * ray);
      point.first_frame = first;
      point.range = RangePrior{supposed, 5.0};
      for (std::size_t k = first; k < first + num_frames; ++k)
        if (const auto px =
                project(run.camera, problem.world_from_cam[k].inverse() * (seen_from * Eigen::Vector3d(far * ray))))
          problem.observations.push_back({k, point.id, *px + 0.5 * draws.normal2(), 0.5});
      problem.points.push_back(point);
    }
    std::ranges::stable_sort(problem.observations, {}, &UsedObservation::frame);
    const auto path = smoothed_path(problem);
    ASSERT_TRUE(path) << seed;
    const PathError error = path_error(timed(problem, path->world_from_cam), run.truth, false);
    EXPECT_LT(error.ate_m, 0.01) << seed;
  }
}

/// A third of the points has errors four times as large as the others', all of them below the stated σ or near it. With
/// equal weights the path's variance is Σσ²/n² of its points', with their own 1/Σσ⁻², a quarter of that.
TEST(PathSmoother, APointCountsByItsOwnErrors) {
  constexpr double usual_px = 0.15, loose = 4.0;
  std::vector<double> of_loose;
  double equal = 0.0, own = 0.0, num_usual = 0.0, num_enlarged = 0.0;
  for (const std::uint64_t seed : {51u, 52u, 53u, 54u}) {
    const double lasting = seed % 2 == 0 ? 0.5 : 0.0;
    const HoverRun run = testing::hovering(
        {.num_frames = 60, .num_others = 40, .sigma_px = usual_px, .lasting = lasting, .loose = loose}, seed);
    SmootherProblem problem = problem_of(run, Eigen::Vector3d::Zero());
    const auto path = smoothed_path(problem);
    problem.weighs_points = false;
    const auto by_equal = smoothed_path(problem);
    ASSERT_TRUE(path && by_equal) << seed;
    const auto error_of = [&](const SmoothedPath& each) {
      return std::pow(path_error(timed(problem, each.world_from_cam), run.truth, false).ate_m, 2);
    };
    own += error_of(*path);
    equal += error_of(*by_equal);
    for (std::size_t i = 0; i < path->ids.size(); ++i) {
      EXPECT_EQ(by_equal->error_factors[i], 1.0);
      if (path->ids[i] % 3 == 1) {
        of_loose.push_back(path->error_factors[i]);
        continue;
      }
      num_usual += 1.0;
      num_enlarged += path->error_factors[i] > 1.0 ? 1.0 : 0.0;
    }
  }
  RecordProperty("own_over_equal", std::to_string(own / equal));
  std::ranges::nth_element(of_loose, of_loose.begin() + static_cast<std::ptrdiff_t>(of_loose.size() / 2));
  EXPECT_NEAR(of_loose[of_loose.size() / 2], loose, 0.2 * loose);
  EXPECT_LT(own, 0.5 * equal);
  EXPECT_LE(num_enlarged, 0.02 * num_usual);
}

/// A point that no lens can have seen where it is said to be gives no guess, and no crash.
TEST(FlatStart, IsNoneWhereAPointCannotBeSupposed) {
  const HoverRun run = testing::hovering({.num_frames = 10, .num_others = 20}, 5);
  SmootherProblem problem = problem_of(run, Eigen::Vector3d::Zero());
  problem.points.push_back({.id = 100000});
  EXPECT_FALSE(flat_start(problem));
}

}  // namespace
}  // namespace alidade
