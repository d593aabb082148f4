#pragma once

#include "alidade/observe/solve/solve.h"

namespace alidade {

/// Of a log that zooms the rows of each constant span are adjusted by themselves. What no zoom changes (distortion
/// where it is one lens, the mounting, the rotation's errors) must be the same in all of them, no span may indicate a
/// cause that was not found, and the last must have the intrinsics that the filter ends with: otherwise a check says
/// so, the rows of each span, and the camera at the end, are those of its own adjustment, and other rows' σ count how
/// far the filter is off.
void compare_constant_spans(const RotationLog& log, const ObserveSetup& config, const Progress& progress,
                            ObserveSolution& report);

}  // namespace alidade
