#pragma once

#include <filesystem>

#include "alidade/observe/move_plan.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Reads what `plan observe` needs from the folder of an `alidade observe` (or its result.json): the camera, its
/// covariance, the noise, and the last observed positions of the points. Throws InputError if it is not an observation,
/// or was refused without a camera.
[[nodiscard]] ObservedNow read_observation(const std::filesystem::path& result);

ALIDADE_PUBLIC_END
}  // namespace alidade
