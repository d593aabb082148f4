#pragma once

#include "alidade/rangefinder/report.h"
#include "alidade/rangefinder/solve/fixed_quantities.h"

namespace alidade {

/// Score tests of errors that the measurements of all shots share, each on its own, everything else re-estimated:
/// readings that drift over the rows, curve over the range or depend on the incidence angle, a surface in front of the
/// corners, spots that wander over the rows, a bent board. None with few shots.
[[nodiscard]] std::vector<ShotCause> error_causes(const BeamProblem& problem, const ReducedSystem& system,
                                                  const SolvedPart& part, const LensPrior& prior,
                                                  const RangefinderReport& report);

/// Effect of a sheet in front of the print, per metre of thickness, on a shot's three errors (reading [m], spot [px]).
[[nodiscard]] Eigen::Vector3d sheet_share(const PreparedShot& shot, const Beam& beam, const Camera& camera,
                                          const ShotModel& model);

/// Uncertainty that the shots leave of a sheet with a given σ in front of the print.
[[nodiscard]] CountedSheet open_sheet(const BeamProblem& problem, const ReducedSystem& system, const SolvedPart& part,
                                      const RangefinderReport& report, const RangefinderConfig& config);

/// σ of a sheet's thickness, prior σ and information of the shots combined. [m]
[[nodiscard]] double left_of(double sigma_m, double information);

}  // namespace alidade
