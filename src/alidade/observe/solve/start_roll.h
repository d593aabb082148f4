#pragma once

#include <span>

#include "alidade/observe/rotation_frame.h"

namespace alidade {

/// Rotation [rad] of the image about the view relative to the rotating part, from the motion of the
/// points compared with the measured rotation. 0 if below 45°: then the adjustment converges without it.
[[nodiscard]] double start_roll(std::span<const RotationFrame> frames);

}  // namespace alidade
