#pragma once

#include <filesystem>

#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Writes to `folder` what the command writes there: result.json, the files of the estimate, report.html; all of them
/// or none. Throws InputError if they cannot be written. `save(outcome_of(calibration), "result")`.
void save(JobOutcome outcome, const std::filesystem::path& folder);

ALIDADE_PUBLIC_END
}  // namespace alidade
