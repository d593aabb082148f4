#pragma once

#include <span>

#include "alidade/loop/servo_study.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document of a servo study (the tables `control`, `steps`, `measurements`, `trials`, `loops` and `lenses`, the
/// grid `robustness`), its printed lines, and servo.csv if anything ran.
[[nodiscard]] JobOutcome outcome_of(const ServoResult& result);

/// One row of the table `control`.
[[nodiscard]] DataTable servo_row(std::span<const RigHead> heads, const ServoRow& row);

ALIDADE_PUBLIC_END
}  // namespace alidade
