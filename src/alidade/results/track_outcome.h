#pragma once

#include "alidade/public.h"
#include "alidade/results/outcome.h"
#include "alidade/track/track_report.h"

namespace alidade {
struct TargetFrame;
ALIDADE_PUBLIC_BEGIN

/// The document of a track, its printed lines, and track.csv and smoothed.csv where there is one.
[[nodiscard]] JobOutcome outcome_of(const TargetTrack& track);

ALIDADE_PUBLIC_END

/// The same of observations that were found in videos: with each video's figures, the table `frames` and events.csv.
/// Where the target is in no frame, that is the verdict.
[[nodiscard]] JobOutcome outcome_of(const TargetTrack& track, const std::vector<TargetFrame>& frames);

}  // namespace alidade
