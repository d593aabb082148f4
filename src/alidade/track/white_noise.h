#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/pantilt/rig.h"
#include "alidade/pantilt/target_observation.h"
#include "alidade/track/track_step.h"

namespace alidade {

/// σ of a pixel coordinate from the part of a head's rays that no smooth motion explains, independent of the rig.
struct WhiteNoise {
  double sigma_px = 0.0;
  double low_px = 0.0, high_px = 0.0;  ///< ± 1σ of it.
  double off_in_sigma = 0.0;  ///< By how much it exceeds the σ it was compared with, in σ; negative: it is smaller.
};

/// From third differences of a head's directions over four consecutive observations, each with its
/// time, across the direction of motion: rig errors, late clocks and the target's path do not affect them, and
/// scattered or rounded times act along the motion only. Median of their magnitudes, robust against a few wrong ones;
/// the encoders' stated noise is subtracted. Observations are in order of capture; those that
/// were not accepted, or have their own σ, are excluded. Compared with `sigma_px`. None for too few.
[[nodiscard]] std::optional<WhiteNoise> white_noise(std::span<const TargetObservation> observations,
                                                    std::span<const RigHead> heads, std::span<const TrackStep> steps,
                                                    double sigma_px, double sigma_encoder_rad);

}  // namespace alidade
