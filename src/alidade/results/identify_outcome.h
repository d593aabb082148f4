#pragma once

#include "alidade/public.h"
#include "alidade/results/outcome.h"
#include "alidade/servo/identification.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document and printed lines of an identification, and servo.yaml if there is a plant.
[[nodiscard]] JobOutcome outcome_of(const Identification& identification);

ALIDADE_PUBLIC_END
}  // namespace alidade
