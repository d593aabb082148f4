#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "alidade/camera/camera.h"

namespace alidade {

/// The parameters of distortion that `free` does not have, of a lens that has any. `kind`: "k", radial; "p",
/// tangential; empty: both.
[[nodiscard]] std::vector<int> fixed_distortion(const Camera& camera, const std::vector<int>& free,
                                                std::string_view kind = "");

/// The lens with a wide prior on the distortion of that kind that its file gives without σ, so that the shots can
/// estimate it.
[[nodiscard]] Camera with_open_distortion(const Camera& camera, std::string_view kind = "");

}  // namespace alidade
