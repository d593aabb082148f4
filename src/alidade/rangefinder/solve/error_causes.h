#pragma once

#include "alidade/rangefinder/report.h"
#include "alidade/rangefinder/solve/fixed_quantities.h"

namespace alidade {

/// Score tests of errors that the measurements of all shots share, each by itself, everything else following: readings
/// that drift over the rows, curve over their range or depend on the angle of incidence, a surface that lies before the
/// corners, spots that wander over the rows, a board that bends. None with few shots.
[[nodiscard]] std::vector<ShotCause> error_causes(const BeamProblem& problem, const ReducedSystem& system,
                                                  const SolvedPart& part, const LensPrior& prior,
                                                  const RangefinderReport& report);

/// What a sheet before the print, a metre thick, does to a shot's three errors: of its reading [m] and spot [px].
[[nodiscard]] Eigen::Vector3d sheet_share(const PreparedShot& shot, const Beam& beam, const Camera& camera,
                                          const ShotModel& model);

/// What the shots leave open of a sheet before the print that was told.
[[nodiscard]] CountedSheet open_sheet(const BeamProblem& problem, const ReducedSystem& system, const SolvedPart& part,
                                      const RangefinderReport& report, const RangefinderConfig& config);

/// σ of a sheet's thickness with what shots say of it. [m]
[[nodiscard]] double left_of(double sigma_m, double information);

}  // namespace alidade
