#pragma once

#include "alidade/camera/camera.h"
#include "alidade/files/json_value.h"

namespace alidade {

/// The `camera` of `estimate`: {model, width, height [px], fx, …}.
[[nodiscard]] JsonValue camera_values(const Camera& camera);
/// The σ of the same names; an empty object without a covariance.
[[nodiscard]] JsonValue camera_stddev(const Camera& camera);

/// Whether the camera has a covariance of all its parameters.
[[nodiscard]] bool has_covariance(const Camera& camera);

}  // namespace alidade
