#include <gtest/gtest.h>

#include <map>

#include "alidade/rig/rig.h"
#include "alidade/simulate/rangefinder.h"
#include "alidade/simulate/rig.h"
#include "alidade/testing/rig_sample.h"

// Lens files that are wrong, and lens files of the other head.

namespace alidade {
namespace {

RigSceneConfig scene_config() {
  RigSceneConfig config;
  config.num_boards = 8;
  return config;
}

RigReport report_on(const RigScene& scene, std::uint64_t seed, const std::map<int, Camera>& cameras) {
  const std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
  return calibrate_rig(views, points_in_board(scene.board), cameras, {});
}

/// Ten pixels at the corners of the image, and readings that scatter as with a wrong camera: neither are the heads
/// exchanged, nor has a board moved.
TEST(IndicatedLens, AWrongDistortionIsNamedAsThat) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const RigScene scene = draw_rig_scene(scene_config(), seed);
    std::map<int, Camera> cameras = testing::cameras_of(scene.rig);
    const int head = seed % 2 == 0 ? 1 : 2;
    Camera& camera = cameras.at(head) = with_distortion(cameras.at(head));
    Eigen::VectorXd lens = params(camera.lens);
    lens[5] += seed < 4 ? 0.2 : -0.2;
    camera.lens = with_params(camera.lens, lens);
    const Verdict verdict = rig_verdict(report_on(scene, seed, cameras), {});
    const std::string said = verdict.sentence + "; " + verdict.to_add;
    EXPECT_NE(said.find("another head" + std::to_string(head) + ".camera.k1"), std::string::npos)
        << seed << ": " << said;
    EXPECT_EQ(said.find("swapped"), std::string::npos) << seed << ": " << said;
    EXPECT_EQ(said.find("moved between"), std::string::npos) << seed << ": " << said;
  }
}

/// Of nearly the same focal length: readings half as bad as a wrong camera's would be, and a lens that seems wrong.
TEST(IndicatedLens, CamerasOfTheOtherHeadAreNamedAsThat) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    RigSceneConfig config = scene_config();
    for (const RigHead& head : draw_rig_scene(config, seed).rig.heads) config.nominal.push_back(head);
    config.nominal[1].camera = mistaken_camera(config.nominal[1].camera, {.focal = 0.01, .centre_px = 6.0});
    const RigScene scene = draw_rig_scene(config, seed);
    std::map<int, Camera> cameras = testing::cameras_of(scene.rig);
    std::swap(cameras.at(1), cameras.at(2));
    EXPECT_EQ(report_on(scene, seed, cameras).status, RigReport::Status::swapped) << seed;
  }
}

}  // namespace
}  // namespace alidade
