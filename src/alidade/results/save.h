#pragma once

#include <filesystem>

#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Leaves in `folder` what the command leaves there: result.json, the files of the estimate, report.html; all of them
/// at once, or none. Throws InputError where they cannot be written. `save(outcome_of(calibration), "result")`.
void save(JobOutcome outcome, const std::filesystem::path& folder);

ALIDADE_PUBLIC_END
}  // namespace alidade
