#pragma once

#include <vector>

#include "alidade/observe/solve/solve.h"

namespace alidade {

/// Checks of the rows in which a filter followed changes of fx, fy, cx, cy: something else may
/// have changed. One estimate per row of the log, with σ from before `widen_before_zooms`.
[[nodiscard]] std::vector<Check> followed_checks(const std::vector<IntrinsicsEstimate>& rows, const RotationLog& log);

/// Rows just before a detected zoom may already belong to it: their σ gets the whole change; that
/// of earlier rows gets at most the part that a single frame would not reveal (a slow zoom).
void widen_before_zooms(std::vector<IntrinsicsEstimate>& rows);

}  // namespace alidade
