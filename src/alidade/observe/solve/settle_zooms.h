#pragma once

#include "alidade/observe/solve/solve.h"

namespace alidade {

[[nodiscard]] bool has_zoom(const ObserveSolution& report);

/// What is not modelled, and errors that last, may look like zooms, and each rest between them be explained by itself.
/// Where all rows fit one camera nearly as well there was no zoom: theirs is the answer. Where they do not but are
/// steady, what they ask for counts. Frames that err as a whole are noise of the rotation.
void settle_zooms(const RotationLog& log, const ObserveSetup& config, const Progress& progress,
                  ObserveSolution& report);

}  // namespace alidade
