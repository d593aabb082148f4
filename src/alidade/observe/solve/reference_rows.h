#pragma once

#include <span>
#include <vector>

#include "alidade/observe/config.h"
#include "alidade/observe/rotation_frame.h"

namespace alidade {

enum class EstimatedRotations {
  none,      ///< The rotations are known.
  free,      ///< Without measurements, or a random walk.
  measured,  ///< Each has a measurement of its own.
};

[[nodiscard]] EstimatedRotations estimated_rotations(RotationKnowledge rotation, RotationSource source);

/// The rows that are adjusted together: those from `from_s` to `until_s`; if rotations are estimated,
/// those of them with pixels, evenly thinned if they are more than can be solved together.
[[nodiscard]] std::vector<bool> reference_rows(std::span<const RotationFrame> frames, double from_s, double until_s,
                                               std::size_t num_points, EstimatedRotations rotations);

}  // namespace alidade
