#pragma once

#include "alidade/calibrate/photo_plan.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The document of the photos to take next, and a line for each.
[[nodiscard]] JobOutcome outcome_of(const PhotoPlan& plan);

ALIDADE_PUBLIC_END
}  // namespace alidade
