#pragma once

#include <span>

#include "alidade/camera/camera.h"
#include "alidade/localize/config.h"

namespace alidade {

/// Throws ConfigError, listing every fault of the config.
void require_sense(const LocalizeConfig& config, const Camera& camera);
/// The same for a frame that follows the one before it (at `last_t_s`; NaN: none).
void require_sense(const ObservationFrame& frame, double last_t_s);
void require_sense(std::span<const TimedPose> truth);

/// The camera with the distortion that the config allows.
[[nodiscard]] Camera known_camera(const Camera& camera, const LocalizeConfig& config);

/// The config as used by a run: alternatives and defaults are resolved to one place; `filter` is that for observations
/// or for images.
[[nodiscard]] LocalizeConfig resolved(LocalizeConfig config, const Camera& camera, bool is_of_images);

/// Sets the state capacity to the maximum that these frames can need: for callers with all frames at hand.
[[nodiscard]] LocalizeConfig sized(LocalizeConfig config, std::span<const ObservationFrame> frames);

}  // namespace alidade
