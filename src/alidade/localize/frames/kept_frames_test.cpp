#include "alidade/localize/frames/kept_frames.h"

#include <gtest/gtest.h>

#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

/// Along a line while it rotates, by the filter `stretch` times too far, and seen from another world.
PathStep step_at(long k, double stretch) {
  PathStep step;
  step.frame = k;
  step.t_s = 0.1 * static_cast<double>(k);
  step.event = k == 0 ? FrameEvent::started : FrameEvent::tracked;
  const double along = 0.02 * static_cast<double>(k);
  step.world_from_cam = {exp_so3(Eigen::Vector3d(0.0, along, 0.0)), stretch * Eigen::Vector3d(along, 0.5 * along, 0.0)};
  step.cov.setIdentity();
  return step;
}

TEST(KeptFrames, ThereAreNeverMoreThanAskedForAndTheFirstIsAmongThem) {
  KeptFrames kept(10);
  for (long k = 0; k < 1000; ++k) {
    kept.add({k, 0.1 * static_cast<double>(k), {}});
    ASSERT_LE(kept.frames().size(), 10u);
    for (std::size_t i = 0; i < kept.frames().size(); ++i)
      ASSERT_EQ(kept.frames()[i].frame, static_cast<long>(i * kept.stride()));
  }
  EXPECT_EQ(kept.stride(), 128u);
  EXPECT_EQ(kept.index_of(0), 0u);
  EXPECT_EQ(kept.index_of(1), 1u);
  EXPECT_EQ(kept.index_of(128), 1u);
  EXPECT_EQ(kept.index_of(999), kept.frames().size() - 1);
}

TEST(KeptFrames, ThoseBetweenGoAsTheFilterWentAndEndAtTheNext) {
  KeptFrames kept(8);
  std::vector<PathStep> path;
  for (long k = 0; k < 23; ++k) {
    path.push_back(step_at(k, 1.1));
    kept.add({k, path.back().t_s, {}});
  }
  ASSERT_EQ(kept.stride(), 4u);
  path[9].event = FrameEvent::restarted;  // from there on the filter's world is elsewhere
  for (std::size_t k = 9; k < path.size(); ++k) path[k].world_from_cam.translation.z() += 7.0;
  std::vector<PathStep> solved = kept.steps(path);
  for (PathStep& step : solved) step = step_at(step.frame, 1.0);
  kept.put_back(solved, path);
  for (std::size_t k = 0; k < path.size(); ++k) {
    const Rigid3 is = path[k].world_from_cam, was = step_at(static_cast<long>(k), 1.0).world_from_cam;
    // Where the filter was reinitialised, or behind the last one kept, it is as long as the filter makes it.
    const bool is_held = k < 8 || (k >= 12 && k <= 20);
    EXPECT_LT((is.translation - was.translation).norm(), is_held ? 1e-3 : 0.02) << k;
    EXPECT_LT(is.rotation.angularDistance(was.rotation), 1e-9) << k;
    EXPECT_NEAR(path[k].cov(0, 0), 1.0, 0.01) << k;
  }
}

}  // namespace
}  // namespace alidade
