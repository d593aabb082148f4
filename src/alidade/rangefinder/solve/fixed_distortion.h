#pragma once

#include <string>
#include <vector>

#include "alidade/camera/camera.h"

namespace alidade {

/// The parameters of radial distortion that `free` does not have, of a lens that has any.
[[nodiscard]] std::vector<int> fixed_distortion(const Camera& camera, const std::vector<int>& free);

/// The lens with the distortion that its file gives without σ open to what the shots say: σ as wide as lenses are.
[[nodiscard]] Camera with_open_distortion(const Camera& camera);

}  // namespace alidade
