#pragma once

#include <span>

#include "alidade/localize/localize.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Fills counts, estimate, stddev and the tables `path` and `features` of the document of `alidade localize`; also for
/// a refusal. `lens_params`: the names of the lens's parameters that were estimated, in order.
void fill_localization(const LocalizeReport& report, std::span<const TimedPose> truth,
                       std::span<const std::string> lens_params, ResultDocument& document);

/// One row of `path`.
[[nodiscard]] DataTable localize_row(const PathStep& step, std::span<const TimedPose> truth);

}  // namespace alidade
