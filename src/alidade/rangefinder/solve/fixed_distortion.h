#pragma once

#include <string>
#include <vector>

#include "alidade/camera/camera.h"

namespace alidade {

/// The parameters of radial and tangential distortion that are not in `free`, for a lens that has any.
[[nodiscard]] std::vector<int> fixed_distortion(const Camera& camera, const std::vector<int>& free);

/// The lens with a wide prior on the distortion that its file gives without σ, so that the shots can estimate it.
[[nodiscard]] Camera with_open_distortion(const Camera& camera);

}  // namespace alidade
