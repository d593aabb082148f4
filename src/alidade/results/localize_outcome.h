#pragma once

#include <span>

#include "alidade/localize/localization.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document and printed lines of a localized path; if there is an estimate, also trajectory.tum, poses.csv,
/// map.csv, map.ply, map.yaml and, if a lens was estimated, camera.yaml.
[[nodiscard]] JobOutcome outcome_of(const Localization& localization);

/// One row of the table `path`, as shown during a run.
[[nodiscard]] DataTable localize_row(const PathStep& step, std::span<const TimedPose> truth);

ALIDADE_PUBLIC_END
}  // namespace alidade
