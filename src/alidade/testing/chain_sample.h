#pragma once

#include "alidade/study/chain.h"
#include "alidade/testing/track_sample.h"

namespace alidade::testing {

/// A target about so far away, followed by the heads as they are, with the rig as it was found. `counted` false: as
/// though rig and lenses were exact.
inline TrackReport track_chain(const Chain& chain, double range_m, std::uint64_t seed, bool counted) {
  const TrackScene scene = chain_track_scene(chain, range_m, seed);
  FollowConfig config;
  config.tracker.sigma_px = scene.sigma_px;
  config.find_sigma_px = false;
  config.tracker.max_depth_m = 60.0;
  if (counted) config.tracker.errors = rig_uncertainty(chain.rig);
  return track_target(observations_of(scene, seed), chain.rig.heads, config, truth_of(scene));
}

}  // namespace alidade::testing
