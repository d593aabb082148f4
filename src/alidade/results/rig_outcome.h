#pragma once

#include "alidade/public.h"
#include "alidade/results/outcome.h"
#include "alidade/rig.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document and printed lines of a rig calibration; if there is a rig, also rig.yaml with a camera_ID.yaml for
/// each head.
[[nodiscard]] JobOutcome outcome_of(const RigCalibration& calibration);

ALIDADE_PUBLIC_END
}  // namespace alidade
