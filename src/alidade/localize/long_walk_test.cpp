#include "alidade/testing/long_walk.h"

#include <gtest/gtest.h>

#include "alidade/localize.h"
#include "alidade/testing/hover.h"

// More points than a filter holds: those that are of little use leave, and come back by their number.

namespace alidade {
namespace {

using testing::long_walk;
using testing::LongWalk;
using testing::WalkRun;

Localization walked(const WalkRun& run, int max_points) {
  LocalizeConfig config;
  config.target.points = run.target;
  config.max_points = max_points;
  return localize(run.frames, run.camera, config, run.truth);
}

TEST(LongWalk, OfFiveHundredPointsNoFrameIsLost) {
  const WalkRun run = long_walk({}, 1);
  for (const int max_points : {0, 60}) {
    const Localization result = walked(run, max_points);
    EXPECT_EQ(result.num_lost, 0u) << max_points;
    EXPECT_GT(result.num_left, 50u) << max_points;
    EXPECT_EQ(result.num_restarts, 0u) << max_points;
    EXPECT_TRUE(result.verdict.ok()) << max_points << ": " << result.verdict.sentence;
    EXPECT_LT(result.error.unaligned_m, 0.12) << max_points;  // 2 % of the way
    EXPECT_GT(result.map.size(), 200u) << max_points;         // points that left are in the map, too
    // No claim of σ: with a hundred points a frame the filter alone is too sure from the first hundred frames on, long
    // before a point leaves (docs/maths/localization.md, What to trust).
    RecordProperty("nees_" + std::to_string(max_points),
                   std::to_string(testing::pose_nees(result.path.back(), run.truth.back().world_from_cam)));
    RecordProperty("unaligned_m_" + std::to_string(max_points), std::to_string(result.error.unaligned_m));
    RecordProperty("left_" + std::to_string(max_points), std::to_string(result.num_left));
    RecordProperty("smoothed_" + std::to_string(max_points), result.is_smoothed ? "yes" : "no");
  }
}

TEST(LongWalk, PointsThatLeftComeBackByTheirNumber) {
  LongWalk scene;
  scene.num_points = 250;
  scene.num_frames = 500;
  scene.length_m = 3.0;
  scene.comes_back = true;
  const WalkRun run = long_walk(scene, 2);
  const Localization result = walked(run, 40);
  EXPECT_EQ(result.num_lost, 0u);
  EXPECT_LT(result.error.unaligned_m, 0.06);
  std::size_t num_of_the_way_there = 0;  // seen at its beginning and at its end
  for (const MapPoint& point : result.map) num_of_the_way_there += point.num_seen > 60 ? 1 : 0;
  EXPECT_GT(num_of_the_way_there, 20u);
}

}  // namespace
}  // namespace alidade
