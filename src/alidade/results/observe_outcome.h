#pragma once

#include "alidade/estimation/counts.h"
#include "alidade/observe/report.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
struct VideoLog;
ALIDADE_PUBLIC_BEGIN

/// Result document and printed lines of an observation; if there is a camera, also camera.yaml and intrinsics.csv; if
/// photos were matched, also pairs.csv.
[[nodiscard]] JobOutcome outcome_of(const ObserveReport& report);

ALIDADE_PUBLIC_END

/// Adds the log made from a video as points.csv, for inspection and reuse, and a line about it.
void add_video(const VideoLog& video, JobOutcome& outcome);

}  // namespace alidade
