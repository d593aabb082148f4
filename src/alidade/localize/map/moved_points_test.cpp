#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "alidade/localize.h"
#include "alidade/simulate/draws.h"
#include "alidade/tables/map_file.h"
#include "alidade/testing/hover.h"

// A map that an earlier run has left, in a scene that is no longer the same, and what of its errors all points share.

namespace alidade {
namespace {

using testing::Hover;
using testing::HoverRun;

struct TwoVisits {
  HoverRun film;
  SavedMap map;                          ///< Of the first of its frames,
  std::vector<ObservationFrame> frames;  ///< and the last.
};

SavedMap by_file(const SavedMap& map, const std::string& name) {
  const auto file = std::filesystem::temp_directory_path() / ("alidade_" + name + ".yaml");
  std::ofstream(file) << map_text(map);
  SavedMap read = read_map(file);
  std::filesystem::remove(file);
  return read;
}

TwoVisits two_visits(std::uint64_t seed, const std::string& name) {
  constexpr std::ptrdiff_t each = 70;
  TwoVisits visits{testing::hovering({.num_frames = 230, .num_others = 34}, seed), {}, {}};
  const std::vector<ObservationFrame>& frames = visits.film.frames;
  LocalizeConfig config;
  config.target.points = visits.film.target;
  const std::vector<ObservationFrame> first(frames.begin(), frames.begin() + each);
  visits.map = by_file(localize(first, visits.film.camera, config).saved_map, name);
  visits.frames.assign(frames.end() - each, frames.end());
  return visits;
}

Localization in_map(const TwoVisits& visits, const SavedMap& map) {
  LocalizeConfig config;
  config.map = map;
  return localize(visits.frames, visits.film.camera, config, visits.film.truth);
}

double mean_nees(const TwoVisits& visits, const Localization& result) {
  double sum = 0.0;
  for (const PathStep& step : result.path)
    sum += testing::pose_nees(step, visits.film.truth[static_cast<std::size_t>(step.frame)].world_from_cam);
  return sum / static_cast<double>(result.path.size());
}

TEST(MapFrame, CountsInThePathOfALaterRun) {
  constexpr int num = 6;
  double with = 0.0, without = 0.0;
  for (int seed = 1; seed <= num; ++seed) {
    const TwoVisits visits = two_visits(static_cast<std::uint64_t>(seed), "map_frame_test");
    ASSERT_TRUE(visits.map.frame);
    const Localization result = in_map(visits, visits.map);
    EXPECT_TRUE(result.verdict.ok()) << result.verdict.sentence;
    EXPECT_EQ(result.moved_points.num, 0u) << result.verdict.sentence;
    with += mean_nees(visits, result) / num;
    SavedMap alone = visits.map;
    alone.frame.reset();
    const Localization relative = in_map(visits, alone);
    EXPECT_NE(relative.verdict.sentence.find("how well its frame is known"), std::string::npos);
    without += mean_nees(visits, relative) / num;
  }
  RecordProperty("with", std::to_string(with));
  RecordProperty("without", std::to_string(without));
  EXPECT_GT(with, 0.3);
  EXPECT_LT(with, 2.0);
  EXPECT_GT(without, 3.0);
}

/// Each of two points in five by itself, far and little.
TEST(MovedMapPoints, AreLeftOutAndNamed) {
  const TwoVisits visits = two_visits(3, "moved_points_test");
  for (const double by_m : {0.1, 0.02}) {
    SavedMap map = visits.map;
    Draws draws(5);
    std::size_t num = 0;
    for (SavedPoint& point : map.points) {
      if (point.id % 5 > 1) continue;
      point.point_in_world += by_m * draws.normal3().normalized();
      ++num;
    }
    const Localization result = in_map(visits, map);
    EXPECT_EQ(result.verdict.state, State::care) << result.verdict.sentence;
    EXPECT_NE(result.verdict.sentence.find("have moved since it was made"), std::string::npos)
        << result.verdict.sentence;
    EXPECT_GE(result.moved_points.num + 1, num);
    EXPECT_LE(result.moved_points.num, num + 1);
    EXPECT_NEAR(result.moved_points.median_m, by_m, 0.1 * by_m);
    EXPECT_LT(mean_nees(visits, result), 4.0) << result.verdict.sentence;
  }
}

/// A part that moved little as one is found to its last point.
TEST(MovedMapPoints, AreFoundWhereAPoseBetweenBothPartsFitsManyOfBoth) {
  const TwoVisits visits = two_visits(6, "moved_little_test");
  SavedMap map = visits.map;
  std::size_t num = 0;
  for (SavedPoint& point : map.points) {
    if (point.id % 3 != 0) continue;
    point.point_in_world += Eigen::Vector3d(0.012, -0.008, 0.0);
    ++num;
  }
  const Localization result = in_map(visits, map);
  EXPECT_GE(result.moved_points.num + 1, num) << result.verdict.sentence;
  EXPECT_LE(result.moved_points.num, num + 1) << result.verdict.sentence;
  EXPECT_LT(mean_nees(visits, result), 4.0) << result.verdict.sentence;
}

/// Of a half that moved as one the other one cannot be told.
TEST(MovedMapPoints, AreNotToldFromThoseThatStayedWhereTheyAreAsMany) {
  const TwoVisits visits = two_visits(4, "moved_half_test");
  SavedMap map = visits.map;
  for (SavedPoint& point : map.points)
    if (point.id % 2 == 0) point.point_in_world += Eigen::Vector3d(0.03, 0.02, -0.01);
  const Localization result = in_map(visits, map);
  EXPECT_EQ(result.verdict.state, State::bad) << result.verdict.sentence;
  EXPECT_NE(result.verdict.sentence.find("which of both parts stayed is not known"), std::string::npos)
      << result.verdict.sentence;
}

}  // namespace
}  // namespace alidade
