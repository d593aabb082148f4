#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/pantilt/rig.h"
#include "alidade/pantilt/target_observation.h"
#include "alidade/track/track_step.h"

namespace alidade {

/// σ of a pixel coordinate by what of a head's rays no smooth motion explains, whatever the rig.
struct WhiteNoise {
  double sigma_px = 0.0;
  double low_px = 0.0, high_px = 0.0;  ///< ± 1σ of it.
  double off_in_sigma = 0.0;           ///< By how much that is more than the σ it was compared with; negative: less.
};

/// From third differences of a head's directions over four of its observations that follow one another, each with its
/// time, across the direction in which it moves: rig errors, late clocks and the target's path leave them, and times
/// that scatter or are rounded act along the motion only. Median of their sizes, so that a few that are wrong do
/// nothing; what the encoders' stated noise explains is taken off. Observations are in order of capture; those that
/// were not accepted, or state their own σ, are left out. Compared with `sigma_px`. None of too few.
[[nodiscard]] std::optional<WhiteNoise> white_noise(std::span<const TargetObservation> observations,
                                                    std::span<const RigHead> heads, std::span<const TrackStep> steps,
                                                    double sigma_px, double sigma_encoder_rad);

}  // namespace alidade
