#pragma once

#include "alidade/network.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document and printed lines of cameras located by a moving target; if they are located, also rig.yaml with a
/// camera_ID.yaml for each head, events.csv (on one clock, for `track`) and path.csv.
[[nodiscard]] JobOutcome outcome_of(const NetworkCalibration& calibration);

ALIDADE_PUBLIC_END
}  // namespace alidade
