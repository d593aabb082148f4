#pragma once

#include <span>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/rangefinder/calibration.h"

namespace alidade {

/// σ against the number of shots that `report` used; counts with a degenerate beam are omitted. Throws Interrupted.
[[nodiscard]] std::vector<CountedSigma> sigma_by_count(std::span<const Shot> shots, const RangefinderReport& report,
                                                       std::span<const Eigen::Vector3d> points_in_board,
                                                       const Camera& camera, const RangefinderConfig& config,
                                                       const Progress& progress = {});

/// Leave-one-out: every used shot (if many, 60 evenly chosen) predicted by the beam of the others: the error to expect
/// of a new shot. Throws Interrupted.
[[nodiscard]] std::vector<LeftOutShot> leave_one_out(std::span<const Shot> shots, const RangefinderReport& report,
                                                     std::span<const Eigen::Vector3d> points_in_board,
                                                     const Camera& camera, const RangefinderConfig& config,
                                                     const Progress& progress = {});

}  // namespace alidade
