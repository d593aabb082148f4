#pragma once

#include "alidade/servo/config.h"

namespace alidade {

/// Factor by which a small offset of an axis from a static target changes per period, if its controller assumes the
/// axis `known` while it is `real`, and images arrive `latency_s` late: below 1 the loop is stable, above 1 the offset
/// grows. Simulated with the controller itself, without noise, for as long as it takes to decide; 1 if the offset
/// neither shrinks nor grows. Dead band, backlash and stops are not modelled: within them, an axis simply stays where
/// it is, at rest.
[[nodiscard]] double settling_per_period(const ServoConfig& config, const ServoAxis& known, const ServoAxis& real,
                                         double focal_px, double latency_s);

}  // namespace alidade
