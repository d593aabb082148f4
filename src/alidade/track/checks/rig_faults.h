#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/track/track_report.h"
#include "alidade/track/tracker.h"

namespace alidade {

/// Of a filter that estimated the errors: each parameter relative to its covariance, the most significant first.
/// Poorly observable parameters, and those within the plane of both rays, are omitted. `is_supposed`: the errors' σ are
/// hypotheses, not given, and the file may be exact; each parameter is then tested alone.
[[nodiscard]] std::vector<RigFault> rig_faults(std::span<const RigHead> heads, const RigUncertainty& errors,
                                               const Tracker::Learned& learned, bool is_supposed);

/// Errors large enough to test where a file gives none: rotated bases, encoders' scales, focal lengths.
[[nodiscard]] RigUncertainty supposed_errors(std::span<const RigHead> heads);

}  // namespace alidade
