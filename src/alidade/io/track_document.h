#pragma once

#include <span>

#include "alidade/io/result_document.h"
#include "alidade/track/track.h"

namespace alidade {

/// Fills counts, estimate, stddev and the tables `steps` and `measurements` of the document of `alidade track`; also
/// for a refusal.
void fill_track(std::span<const TargetSight> sights, std::span<const RigHead> heads, const TrackReport& report,
                const TrueTrack& truth, ResultDocument& document);

}  // namespace alidade
