#pragma once

#include "alidade/observe/solve/solve.h"

namespace alidade {

[[nodiscard]] bool has_zoom(const ObserveSolution& report);

/// Unmodelled effects and lasting errors may look like zooms, and be explained separately in each span between them. If
/// all rows fit one camera nearly as well, there was no zoom: their adjustment is the answer. If they do not, but the
/// camera is constant, the causes they indicate count. Common errors of frames are noise of the rotation.
void settle_zooms(const RotationLog& log, const ObserveSetup& config, const Progress& progress,
                  ObserveSolution& report);

}  // namespace alidade
