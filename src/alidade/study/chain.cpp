#include "alidade/study/chain.h"

#include <map>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/next_photo.h"
#include "alidade/rig/rig.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"

namespace alidade {
namespace {

constexpr ImageSize chain_photo_size{640, 480};
constexpr double corner_noise_px = 0.1;
const Board chain_board{.cols = 9, .rows = 6, .square_m = 0.025};

RigSceneConfig rig_config() {
  RigSceneConfig config;
  for (RigHead head : xiahou_rig()) {
    head.camera = *example_camera("brown", chain_photo_size.width_px, chain_photo_size.height_px);
    config.nominal.push_back(head);
  }
  config.board = chain_board;
  return config;
}

CalibrateReport calibrated(const BoardScene& scene, std::uint64_t seed) {
  return calibrate(chain_board, simulate_views(scene, corner_noise_px, seed), chain_photo_size, {.model = "brown"});
}

/// Photos as they are taken who heeds `plan calibrate` for the last four.
BoardScene planned_scene(const Camera& camera, int num_photos, std::uint64_t seed) {
  BoardSceneConfig config;
  config.num_photos = num_photos - 4;
  BoardScene scene = draw_board_scene(camera, chain_board, config, seed);
  const CalibrateReport first = calibrated(scene, seed);
  for (const NextPhoto& photo :
       plan_next_photos(first.camera, corner_noise_px, points_in_board(chain_board), 4).photos) {
    scene.cam_from_board.push_back(photo.cam_from_board);
  }
  return scene;
}

}  // namespace

std::optional<Chain> draw_chain(std::uint64_t seed, int num_photos) {
  Chain chain{draw_rig_scene(rig_config(), seed), {}};
  std::map<int, Camera> cameras;
  for (const RigHead& head : chain.truth.rig.heads) {
    const std::uint64_t own = 2 * seed + static_cast<std::uint64_t>(head.head.id);
    const CalibrateReport report = calibrated(planned_scene(head.camera, num_photos, own), own + 900000);
    if (report.status != CalibrateReport::Status::converged) return std::nullopt;
    cameras[head.head.id] = report.camera;
  }
  const SimulatedViews views = simulate_head_views(chain.truth, {}, seed);
  const RigReport report =
      calibrate_rig(views.views, points_in_board(chain.truth.board), cameras, {.estimate_scales = true});
  if (report.status != RigReport::Status::converged) return std::nullopt;
  chain.rig = report.rig;
  return chain;
}

TrackScene chain_track_scene(const Chain& chain, double range_m, std::uint64_t seed) {
  TrackScene scene = *track_scenario("A");
  scene.heads = chain.truth.rig.heads;
  scene.duration_s = 3.0;
  scene.aiming_lag_s = 0.1;
  scene.sigma_px = 0.3;
  scene.sigma_encoder_rad = RigNoise{}.sigma_encoder_rad;
  scene.position = drawn_path({0.25, -0.1 * range_m, range_m}, 0.5, scene.duration_s, seed);
  return scene;
}

}  // namespace alidade
