#pragma once

#include <span>

#include "alidade/results/result_document.h"
#include "alidade/track/track_report.h"

namespace alidade {

/// Adds the tables `steps` and `measurements`, of `alidade track` and of what a servo study followed.
void add_track_tables(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                      const TrackReport& report, const TrueTrack& truth, ResultDocument& document);

/// One observation and what became of it, by the names of both tables.
[[nodiscard]] DataTable track_row(const TargetObservation& observation, std::span<const RigHead> heads,
                                  const TrackStep& step, const TrueTrack& truth);

}  // namespace alidade
