#pragma once

#include "alidade/fleet/fleet_camera.h"
#include "alidade/fleet/fleet_model.h"

namespace alidade {

/// Keeps a row to learn from; once there are enough, tries to begin tracking: intrinsics and directions of the points
/// by one adjustment of the kept rows. Where these do not determine them every second row is let go, and rows are kept
/// half as often from then on.
void learn(FleetCamera& camera, const FleetRow& row, const FleetRotation& rotation, const FleetConfig& config);

}  // namespace alidade
