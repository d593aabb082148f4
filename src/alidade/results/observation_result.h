#pragma once

#include <filesystem>

#include "alidade/observe/next_move.h"

namespace alidade {

/// Reads what `plan observe` needs of the folder (or result.json) of an `alidade observe`: the camera, its covariance,
/// the noise, and where the points were last seen. Throws InputError: not an observation, or a refused one that leaves
/// no camera.
[[nodiscard]] ObservedNow read_observation(const std::filesystem::path& result);

}  // namespace alidade
