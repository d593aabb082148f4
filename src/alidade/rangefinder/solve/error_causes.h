#pragma once

#include "alidade/rangefinder/report.h"
#include "alidade/rangefinder/solve/fixed_quantities.h"

namespace alidade {

/// Score tests of errors that the measurements of all shots share, each by itself, everything else following: readings
/// that drift over the rows, readings that curve over their range, spots that wander over the rows.
[[nodiscard]] std::vector<ShotCause> error_causes(const BeamProblem& problem, const ReducedSystem& system,
                                                  const SolvedPart& part, const LensPrior& prior,
                                                  const RangefinderReport& report);

}  // namespace alidade
