#pragma once

#include <optional>
#include <string>

#include "alidade/rig/rig.h"
#include "alidade/rig/rig_work.h"

namespace alidade {

/// What the views indicate of their lenses, each on its own and regardless of the heads: a score test of an additional
/// k1, the boards' poses following; for the head with the most significant one. None if no view has a pose.
[[nodiscard]] std::optional<RigCause> lens_of_views(const Work& work);

/// Corners that are not arranged like those of the board, in more than half of the views with enough of them: how many,
/// in words; empty: they are.
[[nodiscard]] std::string corners_of_another_board(const Work& work);

}  // namespace alidade
