#pragma once

#include "alidade/rangefinder/shot_plan.h"
#include "alidade/results/outcome.h"

namespace alidade {

/// The document of the shots to take next, and a line for each.
[[nodiscard]] JobOutcome outcome_of(const ShotPlan& plan);

}  // namespace alidade
