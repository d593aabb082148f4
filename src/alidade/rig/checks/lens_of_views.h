#pragma once

#include <optional>
#include <string>

#include "alidade/rig/rig.h"
#include "alidade/rig/rig_work.h"

namespace alidade {

/// What the views say of their lenses each by itself, whatever the heads are: a score test of a k1 beside its own
/// distortion, the boards' poses following; of the head of which it is most significant. None where no view has a pose.
[[nodiscard]] std::optional<RigCause> lens_of_views(const Work& work);

/// Corners that do not lie as those of the board, in more than half of the views that have enough of them: how many, in
/// words; empty: they do.
[[nodiscard]] std::string corners_of_another_board(const Work& work);

}  // namespace alidade
