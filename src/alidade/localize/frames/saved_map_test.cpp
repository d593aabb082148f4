#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>

#include "alidade/estimation/config_error.h"
#include "alidade/localize.h"
#include "alidade/tables/map_file.h"
#include "alidade/testing/hover.h"
#include "alidade/testing/long_walk.h"
#include "alidade/testing/room_film.h"

// A map that one run leaves is where another begins.

namespace alidade {
namespace {

using testing::LongWalk;
using testing::RoomFilm;
using testing::RoomScene;

/// The map by way of its file.
SavedMap as_written(const SavedMap& map) {
  const auto file = std::filesystem::temp_directory_path() / "alidade_saved_map_test.yaml";
  std::ofstream(file) << map_text(map);
  SavedMap read = read_map(file);
  std::filesystem::remove(file);
  return read;
}

/// The room without its rectangle looks the same everywhere else.
RoomFilm map_film(bool has_rectangle, int from, int to) {
  RoomScene scene;
  scene.camera = testing::room_camera();
  scene.num_frames = to;
  scene.has_rectangle = has_rectangle;
  return testing::room_film(scene, static_cast<std::size_t>(from));
}

Localization localized_film(const RoomFilm& film, LocalizeConfig config) {
  config.filter.sigma_a_m_s2 = 4.0;
  config.filter.sigma_alpha_rad_s2 = 6.0;
  return testing::localized(film, config);
}

TEST(SavedMap, ImagesBeginInTheMapOfAnEarlierRun) {
  LocalizeConfig with_target, in_map;
  with_target.target = rectangle_target(0.210, 0.1485);
  const Localization first = localized_film(map_film(true, 0, 90), with_target);
  ASSERT_GT(first.saved_map.points.size(), 20u);
  ASSERT_FALSE(first.saved_map.keyframes.empty());
  in_map.map = as_written(first.saved_map);
  // Other images, from other positions; no target is given.
  const Localization second = localized_film(map_film(true, 120, 180), in_map);
  EXPECT_EQ(second.num_lost, 0u) << second.verdict.sentence;
  EXPECT_TRUE(second.is_in_map);
  EXPECT_TRUE(second.scale_known);
  EXPECT_LT(second.error.unaligned_m, 0.01) << second.verdict.sentence;  // in the frame of the first, in metres
  EXPECT_GT(second.saved_map.points.size(), first.saved_map.points.size() / 2);
  EXPECT_NE(second.verdict.exit_code, ExitCode::undetermined);
}

TEST(SavedMap, ImagesOfAnotherPlaceAreRefused) {
  LocalizeConfig with_target, in_map;
  with_target.target = rectangle_target(0.210, 0.1485);
  in_map.map = localized_film(map_film(true, 0, 45), with_target).saved_map;
  RoomFilm elsewhere = map_film(true, 0, 5);
  for (cv::Mat& image : elsewhere.images) cv::flip(image, image, -1);
  const Localization none = localized_film(elsewhere, in_map);
  EXPECT_EQ(none.num_lost, 5u);
  EXPECT_EQ(none.verdict.exit_code, ExitCode::undetermined);
  EXPECT_NE(none.verdict.sentence.find("the map is not found"), std::string::npos) << none.verdict.sentence;
}

TEST(SavedMap, ATableBeginsAnywhereInAMapOfNumberedPoints) {
  LongWalk scene;
  scene.num_points = 150;
  scene.num_frames = 240;
  scene.length_m = 2.5;
  const testing::WalkRun walk = testing::long_walk(scene, 3);
  LocalizeConfig with_target, in_map;
  with_target.target.points = walk.target;
  const Localization first = localize(walk.frames, walk.camera, with_target, walk.truth);
  in_map.map = as_written(first.saved_map);
  ASSERT_GT(in_map.map->points.size(), 100u);
  // Another camera on another day: it begins where no target is, in the middle of the map.
  testing::WalkRun again = testing::long_walk(scene, 3);
  Draws draws(77);
  std::vector<ObservationFrame> frames(again.frames.begin() + 110, again.frames.begin() + 170);
  for (ObservationFrame& frame : frames)
    for (FeatureObservation& observation : frame.observations) observation.px += 0.5 * draws.normal2();
  const Localization second = localize(frames, walk.camera, in_map, walk.truth);
  EXPECT_EQ(second.num_lost, 0u) << second.verdict.sentence;
  EXPECT_TRUE(second.is_in_map);
  EXPECT_LT(second.error.unaligned_m, first.error.unaligned_m + 0.005);
  EXPECT_TRUE(second.verdict.ok()) << second.verdict.sentence;
}

/// All of the map's points are in the filter, also those that the table does not show: at once and frame by frame.
TEST(SavedMap, ATableThatShowsLittleOfTheMapIsAsItComes) {
  testing::Hover scene;
  scene.num_frames = 40;
  scene.num_others = 70;
  const testing::HoverRun film = testing::hovering(scene, 2);
  LocalizeConfig with_target, in_map;
  with_target.target.points = film.target;
  in_map.map = as_written(localize(film.frames, film.camera, with_target).saved_map);
  ASSERT_GT(in_map.map->points.size(), 60u);
  std::vector<ObservationFrame> frames = film.frames;
  for (ObservationFrame& frame : frames)
    std::erase_if(frame.observations, [](const FeatureObservation& each) { return each.id % 6 != 0; });
  const Localization whole = localize(frames, film.camera, in_map);
  Localizer localizer(film.camera, in_map);
  for (const ObservationFrame& frame : frames) localizer.push(frame);
  const Localization coming = localizer.finish();
  EXPECT_TRUE(whole.verdict.ok()) << whole.verdict.sentence;
  EXPECT_EQ(whole.verdict.sentence, coming.verdict.sentence);
  for (std::size_t k = 0; k < frames.size(); ++k)
    EXPECT_EQ(whole.path[k].world_from_cam.translation, coming.path[k].world_from_cam.translation) << k;
}

TEST(SavedMap, WhatDoesNotGoTogetherIsRefused) {
  const testing::WalkRun walk = testing::long_walk({.num_points = 50, .num_frames = 60, .length_m = 0.5}, 3);
  LocalizeConfig config;
  config.target.points = walk.target;
  const SavedMap numbered = localize(walk.frames, walk.camera, config).saved_map;
  config.map = numbered;
  EXPECT_THROW((void)localize(walk.frames, walk.camera, config), ConfigError);  // a target as well
  config.target = {};
  EXPECT_THROW((void)localized_film(map_film(true, 0, 1), config), ConfigError);  // of numbers, for images
  config.map->points.push_back(numbered.points.front());
  EXPECT_THROW((void)localize(walk.frames, walk.camera, config), ConfigError);  // a point twice
}

}  // namespace
}  // namespace alidade
