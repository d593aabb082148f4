#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "alidade/network/moving_target.h"

namespace alidade {

/// How cameras are located from these observations through these lenses; their clocks are searched so far. 0: one
/// clock.
using PlaceCameras = std::function<MovingTargetReport(const std::vector<TargetObservation>& observations,
                                                      const std::vector<RigHead>& heads, double clock_search_s)>;

/// Not all cameras are located, or not well: where something may be wrong, the start or what was given.
[[nodiscard]] bool is_doubtful(const MovingTargetReport& report);
/// Whether more cameras are located than by the other, or as many and they agree better by a tenth.
[[nodiscard]] bool agrees_better(const MovingTargetReport& report, const MovingTargetReport& other);

/// Names a camera whose images are mirrored or whose clock is another, or two cameras whose lenses are exchanged: where
/// undoing that makes all cameras agree. One sentence; empty where nothing is wrong, or none of these explains it.
/// `clock_search_s`: with which `report` was made.
[[nodiscard]] std::string camera_fault_of(const MovingTargetReport& report,
                                          std::span<const TargetObservation> observations,
                                          std::span<const RigHead> heads, double clock_search_s,
                                          const PlaceCameras& place);

}  // namespace alidade
