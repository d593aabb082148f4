#pragma once

#include "alidade/observe/solve/solve.h"

namespace alidade {

/// In a log with zooms, the rows of each constant span are adjusted alone. Parameters that do not
/// change with zoom (the distortion of a single lens, the mounting, errors of the rotation) must agree
/// between the spans, no span may indicate a cause that was not found before, and the last span must
/// agree with the filter's final intrinsics. Otherwise a check says so, the rows of each span and the
/// final camera come from its own adjustment, and σ of the other rows includes the error of the filter.
void compare_constant_spans(const RotationLog& log, const ObserveSetup& config, const Progress& progress,
                            ObserveSolution& report);

}  // namespace alidade
