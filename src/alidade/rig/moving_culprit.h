#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "alidade/rig/moving_target.h"

namespace alidade {

/// How cameras are placed from these sights through these lenses.
using PlaceCameras =
    std::function<MovingTargetReport(const std::vector<TargetSight>& sights, const std::vector<RigHead>& heads)>;

/// Which camera it is whose images are mirrored, or which two have each other's lens: undone, all cameras agree where
/// they did not. One sentence; empty where nothing is amiss, or none of these explains it.
[[nodiscard]] std::string culprit_of(const MovingTargetReport& report, std::span<const TargetSight> sights,
                                     std::span<const RigHead> heads, const PlaceCameras& place);

}  // namespace alidade
