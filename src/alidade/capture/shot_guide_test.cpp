// Guided shots of a rangefinder against those of somebody who holds the board anywhere.
#include <gtest/gtest.h>

#include <cmath>

#include "alidade/capture.h"
#include "alidade/simulate/rangefinder.h"

namespace alidade {
namespace {

RangefinderScene reference_scene(int num_shots) {
  RangefinderSceneConfig config = *rangefinder_scenario("reference");
  config.num_shots = num_shots;
  return draw_rangefinder_scene(config, 5);
}

/// The reading of a beam on a board at that pose.
double range_on(const Beam& beam, const Rigid3& cam_from_board) {
  const Plane plane = plane_of(cam_from_board);
  return -(plane.normal_in_cam.dot(beam.origin_in_cam) + plane.d_m) / plane.normal_in_cam.dot(beam.direction_in_cam);
}

TEST(ShotGuide, GuidedShotsTellMoreThanAsManyOthers) {
  const RangefinderScene scene = reference_scene(8);
  const std::vector<Shot> shots = simulate_shots(scene, {}, 5).shots;
  RangefinderConfig config;
  config.board = scene.board;
  ShotGuide guided(scene.camera, config), random(scene.camera, config);
  EXPECT_FALSE(guided.state().words.empty());
  for (std::size_t i = 0; i < 8; ++i) {
    (void)random.push(shots[i]);
    if (i < 5) (void)guided.push(shots[i]);
  }
  ASSERT_TRUE(guided.state().has_beam) << guided.state().verdict.sentence;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(guided.state().next);
    const double before_m = guided.state().sigma_origin_m;
    RangefinderScene next = scene;
    next.cam_from_board = {guided.state().next->cam_from_board};
    next.range_m = {range_on(scene.beam, next.cam_from_board.front())};
    (void)guided.push(simulate_shots(next, {}, 10 + static_cast<std::uint64_t>(i)).shots.front());
    EXPECT_LT(guided.state().sigma_origin_m, 1.1 * before_m);
  }
  EXPECT_LT(guided.state().sigma_origin_m, random.state().sigma_origin_m);
  EXPECT_EQ(guided.state().shots, 8);
  guided.undo();
  EXPECT_EQ(guided.state().shots, 7);
}

TEST(ShotGuide, SaysWhereToBeginAndRefusesWhatCannotBe) {
  const RangefinderScene scene = reference_scene(3);
  ShotGuide guide(scene.camera);
  EXPECT_EQ(guide.state().shots, 0);
  EXPECT_NE(guide.state().words.find("m away"), std::string::npos);
  EXPECT_THROW((void)guide.push({.range_m = std::nan("")}), ConfigError);
  EXPECT_EQ(guide.state().shots, 0);
  EXPECT_THROW(ShotGuide(scene.camera, {}, {.max_tilt_deg = 200.0}), ConfigError);
}

}  // namespace
}  // namespace alidade
