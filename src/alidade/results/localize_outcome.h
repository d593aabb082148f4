#pragma once

#include <span>

#include "alidade/localize/localization.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The document of a path, its printed lines, and where there is an estimate trajectory.tum, poses.csv, map.csv,
/// map.ply, map.yaml and, of a lens that was estimated, camera.yaml.
[[nodiscard]] JobOutcome outcome_of(const Localization& localization);

/// One row of the table `path`: what is shown while a run goes on.
[[nodiscard]] DataTable localize_row(const PathStep& step, std::span<const TimedPose> truth);

ALIDADE_PUBLIC_END
}  // namespace alidade
