#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "alidade/network/moving_target.h"

namespace alidade {

/// How cameras are located from these observations through these lenses; whether their clocks are searched, or one.
using PlaceCameras = std::function<MovingTargetReport(const std::vector<TargetObservation>& observations,
                                                      const std::vector<RigHead>& heads, bool searches)>;

/// Which camera it is whose images are mirrored, or which two have each other's lens: undone, all cameras agree where
/// they did not. One sentence; empty where nothing is amiss, or none of these explains it.
[[nodiscard]] std::string culprit_of(const MovingTargetReport& report, std::span<const TargetObservation> observations,
                                     std::span<const RigHead> heads, const PlaceCameras& place);

}  // namespace alidade
