#pragma once

#include <span>
#include <string>

#include "alidade/loop/servo_study.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Fills counts, estimate, the tables `control` (first trial of the best controller), `steps` and `measurements` (what
/// `track` makes of that trial), `trials`, `loops`, and the grid `robustness` of the document of `alidade servo`; also
/// for a refusal.
void fill_servo(const ServoScenario& scenario, const ServoStudy& study, ResultDocument& document);

/// One row of `control`.
[[nodiscard]] DataTable servo_row(std::span<const RigHead> heads, const ServoRow& row);

/// Text of servo.csv: the first trial of every controller, a row a head and period.
[[nodiscard]] std::string servo_csv(const ServoScenario& scenario, const ServoStudy& study);

}  // namespace alidade
