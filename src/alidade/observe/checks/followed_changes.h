#pragma once

#include <vector>

#include "alidade/observe/solve/solve.h"

namespace alidade {

/// Checks of what a filter's rows followed as changes of fx, fy, cx, cy: something else may have changed. One row per
/// row of the log, with their σ before `widen_before_zooms`.
[[nodiscard]] std::vector<Check> followed_checks(const std::vector<IntrinsicsEstimate>& rows, const RotationLog& log);

/// The rows just before a zoom was noticed may be of it already: their σ includes the change that came, in those before
/// them no more of it than one frame would not show (a slow zoom).
void widen_before_zooms(std::vector<IntrinsicsEstimate>& rows);

}  // namespace alidade
