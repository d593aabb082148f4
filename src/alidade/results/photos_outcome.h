#pragma once

#include "alidade/calibrate/photo_plan.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document of the photos to take next, and one printed line per photo.
[[nodiscard]] JobOutcome outcome_of(const PhotoPlan& plan);

ALIDADE_PUBLIC_END
}  // namespace alidade
