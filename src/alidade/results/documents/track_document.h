#pragma once

#include <span>

#include "alidade/results/result_document.h"
#include "alidade/track/track_report.h"

namespace alidade {

/// Adds the tables `steps` and `measurements`, for `alidade track` and for the targets of a servo study.
void add_track_tables(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                      const TrackReport& report, const TrueTrack& truth, ResultDocument& document);

/// One observation and its outcome, with the column names of both tables.
[[nodiscard]] DataTable track_row(const TargetObservation& observation, std::span<const RigHead> heads,
                                  const TrackStep& step, const TrueTrack& truth);

}  // namespace alidade
