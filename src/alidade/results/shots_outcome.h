#pragma once

#include "alidade/public.h"
#include "alidade/rangefinder/shot_plan.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document of the shots to take next, and one printed line per shot.
[[nodiscard]] JobOutcome outcome_of(const ShotPlan& plan);

ALIDADE_PUBLIC_END
}  // namespace alidade
