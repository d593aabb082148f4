#pragma once

#include "alidade/observe/observer.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Fills counts, estimate, stddev, covariance and data of the document of `alidade observe`, also for a refusal.
void fill_observation(const ObserveReport& report, ResultDocument& document);

/// One row of the table `steps`.
[[nodiscard]] DataTable observe_row(const ObserveStep& step);

}  // namespace alidade
