#pragma once

#include <optional>
#include <string_view>

#include "alidade/camera/camera.h"

namespace alidade {

/// A realistic camera of a model and image size, for simulations without a given one: about 64° wide (100° for
/// kannala_brandt, 47° in water for flat_port), principal point slightly off the centre, with barrel distortion. None
/// for an unknown model.
[[nodiscard]] std::optional<Camera> example_camera(std::string_view model_name, int width_px, int height_px);

}  // namespace alidade
