#include "alidade/testing/long_walk.h"

#include <gtest/gtest.h>

#include "alidade/localize.h"
#include "alidade/testing/hover.h"
#include "alidade/testing/trials.h"

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
    EXPECT_TRUE(result.is_smoothed) << max_points;
    EXPECT_LT(result.error.unaligned_m, 0.03) << max_points;  // 0.5 % of the way
    EXPECT_GT(result.map.size(), 200u) << max_points;         // points that left are in the map, too
    RecordProperty("nees_" + std::to_string(max_points),
                   std::to_string(testing::pose_nees(result.path.back(), run.truth.back().world_from_cam)));
    RecordProperty("unaligned_m_" + std::to_string(max_points), std::to_string(result.error.unaligned_m));
    RecordProperty("left_" + std::to_string(max_points), std::to_string(result.num_left));
  }
}

/// The filter alone has 10 to 30 here: points that leave end what it is right to be sure of. A run's error is mostly
/// one draw of six numbers: a mean over five scatters by √(2/6/5) = 0.26.
TEST(LongWalk, ThePoseIsAsGoodAsItsCovarianceSays) {
  const auto num_seeds = static_cast<std::uint64_t>(testing::trials(5));
  double nees = 0.0;
  for (std::uint64_t seed = 1; seed <= num_seeds; ++seed) {
    const WalkRun run = long_walk({.num_points = 300, .num_frames = 450, .sigma_known_m = 0.001}, 100 + seed);
    const Localization result = walked(run, 40);
    EXPECT_TRUE(result.is_smoothed) << seed;
    for (std::size_t k = 0; k < result.path.size(); ++k)
      nees += testing::pose_nees(result.path[k], run.truth[k].world_from_cam) /
              static_cast<double>(num_seeds * result.path.size());
  }
  RecordProperty("nees", std::to_string(nees));
  EXPECT_GT(nees, 0.5);
  EXPECT_LT(nees, 1.6);
}

/// The whole of a recording that is too long is every fourth of its frames: less sure, and as sure as it says.
TEST(LongWalk, OfALongRecordingEveryFourthFrameIsSolvedForAndTheOthersFollow) {
  const auto num_seeds = static_cast<std::uint64_t>(testing::trials(4));
  double nees = 0.0, between = 0.0;
  for (std::uint64_t seed = 1; seed <= num_seeds; ++seed) {
    const WalkRun run = long_walk({.num_points = 300, .num_frames = 450, .sigma_known_m = 0.001}, 200 + seed);
    LocalizeConfig config;
    config.target.points = run.target;
    config.max_points = 40;
    config.max_smoothed = 150;
    const Localization result = localize(run.frames, run.camera, config, run.truth);
    EXPECT_TRUE(result.is_smoothed) << seed;
    EXPECT_EQ(result.smoothed_every, 4u);
    EXPECT_EQ(result.path.size(), run.frames.size());
    EXPECT_TRUE(result.verdict.ok()) << result.verdict.sentence;
    EXPECT_LT(result.error.unaligned_m, 0.06) << seed;
    for (std::size_t k = 0; k < result.path.size(); ++k) {
      const double here = testing::pose_nees(result.path[k], run.truth[k].world_from_cam) /
                          static_cast<double>(num_seeds * result.path.size());
      nees += here;
      if (k % 4 != 0) between += here * 4.0 / 3.0;
    }
  }
  RecordProperty("nees", std::to_string(nees));
  RecordProperty("between", std::to_string(between));
  EXPECT_GT(nees, 0.5);
  EXPECT_LT(nees, 1.6);
  EXPECT_LT(between, 1.7);
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
