#pragma once

#include <filesystem>

#include "alidade/io/outcome.h"
#include "alidade/public.h"

namespace ALIDADE_PUBLIC alidade {

/// Leaves in `folder` what the command leaves there: result.json, the files of the estimate, report.html; all of them
/// at once, or none. Throws InputError where they cannot be written. `save(outcome_of(calibration), "result")`.
void save(JobOutcome outcome, const std::filesystem::path& folder);

}  // namespace alidade
