#pragma once

#include "alidade/rangefinder/report.h"
#include "alidade/rangefinder/solve/fixed_quantities.h"

namespace alidade {

/// Score tests of errors that the measurements of all shots share, each by itself, everything else following: readings
/// that drift over the rows, curve over their range or depend on the angle of incidence, a surface that lies before the
/// corners, spots that wander over the rows, a board that bends. With few shots none is tested: what they leave open of
/// each is all that is said.
[[nodiscard]] std::vector<ShotCause> error_causes(const BeamProblem& problem, const ReducedSystem& system,
                                                  const SolvedPart& part, const LensPrior& prior,
                                                  const RangefinderReport& report, const RangefinderConfig& config);

}  // namespace alidade
