#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/track/track.h"

namespace alidade {

/// Innovations that scatter along the target's motion in the image in proportion to its speed, in both directions, and
/// independently from row to row. None if larger noise, or clocks with a constant offset, explain them as well.
[[nodiscard]] std::optional<TimeJitter> time_jitter(std::span<const TargetObservation> observations,
                                                    std::span<const RigHead> heads, std::span<const TrackStep> steps,
                                                    double gate);

/// "capture times scatter by 15 ms (1σ): …". `step_s`: the step of the times, or 0.
[[nodiscard]] std::string jitter_text(const TimeJitter& jitter, double step_s);
[[nodiscard]] std::string jitter_remedy();

}  // namespace alidade
