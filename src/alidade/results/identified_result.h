#pragma once

#include <array>
#include <filesystem>

#include "alidade/pantilt/positioner.h"

namespace alidade {

/// Pan and tilt of a head as they were identified, and the larger step of what they read.
struct IdentifiedHead {
  std::array<PositionerParams, 2> axes;
  double resolution_rad = 0.0;
};

/// Reads what `head --follow` needs of the folder (or result.json) of an `alidade head --identify`; what its log did
/// not show is as it usually is. Throws InputError: not such a result, or a refused one.
[[nodiscard]] IdentifiedHead read_identified_head(const std::filesystem::path& result,
                                                  const PositionerParams& usual_axis);

}  // namespace alidade
