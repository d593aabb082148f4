#pragma once

#include <array>
#include <filesystem>

#include "alidade/pantilt/positioner.h"

namespace alidade {

/// Identified pan and tilt axes of a head, and the larger step of its readings.
struct IdentifiedHead {
  std::array<PositionerParams, 2> axes;
  double resolution_rad = 0.0;
};

/// Reads what `head --follow` needs from the folder of an `alidade head --identify` (or its result.json); what its log
/// did not determine has its usual value. Throws InputError if it is not such a result, or was refused.
[[nodiscard]] IdentifiedHead read_identified_head(const std::filesystem::path& result,
                                                  const PositionerParams& usual_axis);

}  // namespace alidade
