#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/track/track_report.h"
#include "alidade/track/tracker.h"

namespace alidade {

/// Of a filter that learned the errors: each number against what its covariance allows, the most surprising first.
/// Numbers that the observations hardly tell, and those within the plane of both rays, are omitted. `is_supposed`: the
/// errors are no one's σ but a question, and the file's numbers may be exact; each is then asked about by itself.
[[nodiscard]] std::vector<RigFault> rig_faults(std::span<const RigHead> heads, const RigUncertainty& errors,
                                               const Tracker::Learned& learned, bool is_supposed);

/// Errors large enough to ask about where a file gives none: turned bases, encoders' scales, focal lengths.
[[nodiscard]] RigUncertainty supposed_errors(std::span<const RigHead> heads);

}  // namespace alidade
