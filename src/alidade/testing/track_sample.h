#pragma once

#include "alidade/reproduce/track_trials.h"

namespace alidade::testing {

using reproduce::observations_of;
using reproduce::truth_of;

/// Scenario C with a third head, half a metre beside the second, all at 20 Hz and at times of their own.
inline TrackScene three_heads() {
  TrackScene scene = *track_scenario("C");
  scene.heads.push_back(scene.heads[1]);
  scene.heads[2].head.id = 3;
  scene.heads[2].head.world_from_base.translation += Eigen::Vector3d(0.5, 0.0, 0.0);
  scene.rate_hz = {20.0, 20.0, 20.0};
  scene.phase_s = {0.0, 0.013, 0.029};
  return scene;
}

}  // namespace alidade::testing
