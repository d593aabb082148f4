#pragma once

#include "alidade/observe/move_plan.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document of a plan of moves, and one printed line per move.
[[nodiscard]] JobOutcome outcome_of(const MovePlan& plan);

ALIDADE_PUBLIC_END
}  // namespace alidade
