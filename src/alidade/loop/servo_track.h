#pragma once

#include <vector>

#include "alidade/loop/servo_loop.h"
#include "alidade/public.h"
#include "alidade/track/track_report.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Positions of the target as `track` estimates them from the observations by the heads in one run.
struct ServoTrack {
  std::vector<TargetObservation> observations;
  TrueTrack truth;
  TrackReport report;
};
[[nodiscard]] ServoTrack track_of(const ServoScene& scene, const ServoRun& run);

ALIDADE_PUBLIC_END
}  // namespace alidade
