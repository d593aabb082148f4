#include <gtest/gtest.h>

#include <algorithm>

#include "alidade/localize/path/path_error.h"
#include "alidade/localize/path/path_smoother.h"
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

/// A point that no lens can have seen where it is said to be gives no guess, and no crash.
TEST(FlatStart, IsNoneWhereAPointCannotBeSupposed) {
  const HoverRun run = testing::hovering({.num_frames = 10, .num_others = 20}, 5);
  SmootherProblem problem = problem_of(run, Eigen::Vector3d::Zero());
  problem.points.push_back({.id = 100000});
  EXPECT_FALSE(flat_start(problem));
}

}  // namespace
}  // namespace alidade
