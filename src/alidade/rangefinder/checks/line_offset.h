#pragma once

#include <span>

#include "alidade/rangefinder/rangefinder.h"

namespace alidade {

/// Distance of the beam's line from the camera centre.
struct LineOffset {
  double value_m = 0.0, sigma_m = 0.0;
};

/// From the estimated beam; if that does not determine it, from the spots.
[[nodiscard]] LineOffset line_offset(const RangefinderReport& report, std::span<const Shot> shots);

/// Only if the shots determine it: a line far from the centre that is poorly known is another matter.
[[nodiscard]] bool passes_the_centre(const LineOffset& offset);

}  // namespace alidade
