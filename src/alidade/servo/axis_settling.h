#pragma once

#include "alidade/servo/config.h"

namespace alidade {

/// By how much a small offset of an axis from a target at rest shrinks in each period, its controller knowing the axis
/// as `known` while it is `real`: below 1 the loop is stable. Measured on the controller itself, whatever it does,
/// without noise; 1 or more also where the offset stays as large as it was.
[[nodiscard]] double settling_per_period(const ServoConfig& config, const ServoAxis& known, const ServoAxis& real,
                                         double focal_px);

}  // namespace alidade
