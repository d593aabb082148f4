#pragma once

#include "alidade/public.h"
#include "alidade/results/outcome.h"
#include "alidade/rig.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The document of a rig, its printed lines, and rig.yaml with a camera_ID.yaml for each head where there is a
/// rig.
[[nodiscard]] JobOutcome outcome_of(const RigCalibration& calibration);

ALIDADE_PUBLIC_END
}  // namespace alidade
