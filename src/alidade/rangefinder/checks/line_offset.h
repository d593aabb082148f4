#pragma once

#include <span>

#include "alidade/rangefinder/rangefinder.h"

namespace alidade {

/// How far the beam's line passes from the camera's centre.
struct LineOffset {
  double value_m = 0.0, sigma_m = 0.0;
};

/// Of the solved beam; where that does not know it, of the spots.
[[nodiscard]] LineOffset line_offset(const RangefinderReport& report, std::span<const Shot> shots);

/// Only where the shots do say so: a line that passes far off, however badly known, is another matter.
[[nodiscard]] bool passes_the_centre(const LineOffset& offset);

}  // namespace alidade
