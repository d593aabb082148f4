#pragma once

#include <span>

#include "alidade/camera/camera.h"
#include "alidade/localize/config.h"

namespace alidade {

/// Throws ConfigError with every fault of what was asked.
void require_sense(const LocalizeConfig& config, const Camera& camera);
/// The same of what is to follow the frame before it (at `last_t_s`; NaN: none).
void require_sense(const ObservationFrame& frame, double last_t_s);
void require_sense(std::span<const TimedPose> truth);

/// The camera with the distortion that the config allows.
[[nodiscard]] Camera known_camera(const Camera& camera, const LocalizeConfig& config);

/// The config as a run uses it: what may be given in two places, or not at all, stands in one; `filter` is that of
/// observations or of images.
[[nodiscard]] LocalizeConfig resolved(LocalizeConfig config, const Camera& camera, bool is_of_images);

/// The state as large as these frames can need: for who has them all at once.
[[nodiscard]] LocalizeConfig sized(LocalizeConfig config, std::span<const ObservationFrame> frames);

}  // namespace alidade
