#pragma once

#include <filesystem>

#include "alidade/observe/move_plan.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Reads what `plan observe` needs of the folder (or result.json) of an `alidade observe`: the camera, its covariance,
/// the noise, and where the points were last seen. Throws InputError: not an observation, or a refused one that leaves
/// no camera.
[[nodiscard]] ObservedNow read_observation(const std::filesystem::path& result);

ALIDADE_PUBLIC_END
}  // namespace alidade
