#pragma once

#include <span>

#include "alidade/observe/rotation_frame.h"

namespace alidade {

/// How far the image is turned about the view against what rotates, as the way of the points beside the rotation tells
/// it. Below half a right angle 0: from there the adjustment finds it by itself. [rad]
[[nodiscard]] double start_roll(std::span<const RotationFrame> frames);

}  // namespace alidade
