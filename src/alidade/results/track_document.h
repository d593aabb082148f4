#pragma once

#include <span>

#include "alidade/detect/video_observations.h"
#include "alidade/results/result_document.h"
#include "alidade/track/track.h"

namespace alidade {

/// Fills counts, estimate, stddev and the tables `steps` and `measurements` of the document of `alidade track`; also
/// for a refusal.
void fill_track(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                const TrackReport& report, const TrueTrack& truth, ResultDocument& document);

/// Adds these tables alone.
void add_track_tables(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                      const TrackReport& report, const TrueTrack& truth, ResultDocument& document);

/// One observation and what became of it, by the names of both tables.
[[nodiscard]] DataTable track_row(const TargetObservation& observation, std::span<const RigHead> heads,
                                  const TrackStep& step, const TrueTrack& truth);

/// Adds what videos were searched for: `estimate.video`, a list of {head, frames, seen}, and the table `frames`.
void fill_target_frames(std::span<const TargetFrame> frames, std::span<const RigHead> heads, ResultDocument& document);

}  // namespace alidade
