#pragma once

#include <span>

#include "alidade/observe/rotation_frame.h"

namespace alidade {

/// How far the image is rotated about the view against what rotates, as the motion of the points beside the rotation
/// shows it. Below half a right angle 0: from there the adjustment finds it by itself. [rad]
[[nodiscard]] double start_roll(std::span<const RotationFrame> frames);

}  // namespace alidade
