#pragma once

#include "alidade/public.h"
#include "alidade/results/outcome.h"
#include "alidade/servo/identification.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The document of an identification, its printed lines, and servo.yaml where there is a plant.
[[nodiscard]] JobOutcome outcome_of(const Identification& identification);

ALIDADE_PUBLIC_END
}  // namespace alidade
