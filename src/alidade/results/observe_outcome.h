#pragma once

#include "alidade/estimation/counts.h"
#include "alidade/observe/report.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
struct VideoLog;
ALIDADE_PUBLIC_BEGIN

/// The document of an observation, its printed lines, camera.yaml where there is a camera, intrinsics.csv with it, and
/// pairs.csv where photos were matched.
[[nodiscard]] JobOutcome outcome_of(const ObserveReport& report);

ALIDADE_PUBLIC_END

/// The log that a video gave: points.csv, to be looked at and used again, and a line about it.
void add_video(const VideoLog& video, JobOutcome& outcome);

}  // namespace alidade
