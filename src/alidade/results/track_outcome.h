#pragma once

#include "alidade/public.h"
#include "alidade/results/outcome.h"
#include "alidade/track/track_report.h"

namespace alidade {
struct TargetFrame;
ALIDADE_PUBLIC_BEGIN

/// Result document and printed lines of a track; if there is one, also track.csv and smoothed.csv.
[[nodiscard]] JobOutcome outcome_of(const TargetTrack& track);

ALIDADE_PUBLIC_END

/// The same for observations detected in videos: adds each video's figures, the table `frames` and events.csv. If no
/// frame shows the target, the verdict says so.
[[nodiscard]] JobOutcome outcome_of(const TargetTrack& track, const std::vector<TargetFrame>& frames);

}  // namespace alidade
