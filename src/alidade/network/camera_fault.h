#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "alidade/network/moving_target.h"

namespace alidade {

/// How cameras are located from these observations through these lenses; clock offsets up to this are searched. 0: one
/// clock.
using PlaceCameras = std::function<MovingTargetReport(const std::vector<TargetObservation>& observations,
                                                      const std::vector<RigHead>& heads, double clock_search_s)>;

/// Not all cameras are located, or not well: the initial guess or the input may be wrong.
[[nodiscard]] bool is_doubtful(const MovingTargetReport& report);
/// Whether more cameras are located than with the other, or as many and they agree better by a tenth.
[[nodiscard]] bool agrees_better(const MovingTargetReport& report, const MovingTargetReport& other);

/// Names a camera with mirrored images or a different clock, or two cameras with exchanged lenses: if
/// correcting that makes all cameras agree. One sentence; empty if nothing is wrong, or none of these explains it.
/// `clock_search_s`: as used for `report`.
[[nodiscard]] std::string camera_fault_of(const MovingTargetReport& report,
                                          std::span<const TargetObservation> observations,
                                          std::span<const RigHead> heads, double clock_search_s,
                                          const PlaceCameras& place);

}  // namespace alidade
