#pragma once

#include <map>
#include <optional>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/rig/rig.h"
#include "alidade/simulate/rig.h"
#include "alidade/testing/calibration_sample.h"
#include "alidade/testing/track_sample.h"
#include "alidade/track/track.h"

// The whole way of two heads, each step with what the one before found: photos of a board → lenses → views of boards →
// the rig → a target followed.

namespace alidade::testing {

struct Chain {
  RigScene truth;
  Rig rig;  ///< As found, through the lenses as found.
};

inline RigSceneConfig chain_config() {
  RigSceneConfig config;
  for (RigHead head : xiahou_rig()) {
    head.camera = sample_camera("brown");
    config.nominal.push_back(head);
  }
  config.board = sample_board;
  return config;
}

/// None where a step has no answer.
inline std::optional<Chain> draw_chain(std::uint64_t seed, int num_photos = 13) {
  Chain chain{draw_rig_scene(chain_config(), seed), {}};
  std::map<int, Camera> cameras;
  for (const RigHead& head : chain.truth.rig.heads) {
    const std::uint64_t own = 2 * seed + static_cast<std::uint64_t>(head.head.id);
    const auto views = sample_views(covered_scene(head.camera, num_photos, own), own + 900000);
    const CalibrateReport report = calibrate(sample_board, views, sample_size, {.model = "brown"});
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

/// A target about so far away, followed by the heads as they are, with the rig as it was found. `counted` false: as
/// though rig and lenses were exact.
inline TrackReport track_chain(const Chain& chain, double range_m, std::uint64_t seed, bool counted) {
  TrackScene scene = *track_scenario("A");
  scene.heads = chain.truth.rig.heads;
  scene.duration_s = 3.0;
  scene.aiming_lag_s = 0.1;
  scene.sigma_px = 0.3;
  scene.sigma_encoder_rad = RigNoise{}.sigma_encoder_rad;
  scene.position = drawn_path({0.25, -0.1 * range_m, range_m}, 0.5, scene.duration_s, seed);
  FollowConfig config;
  config.tracker.sigma_px = scene.sigma_px;
  config.tracker.max_depth_m = 60.0;
  if (counted) config.tracker.errors = rig_uncertainty(chain.rig);
  return track_target(observations_of(scene, seed), chain.rig.heads, config, truth_of(scene));
}

}  // namespace alidade::testing
