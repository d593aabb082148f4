#pragma once

#include <string>

#include "alidade/camera/camera.h"

namespace alidade {

/// What is wrong with a camera as a program filled it; empty where it is usable: no image size, parameters that are not
/// finite, focal lengths not above zero, a covariance of another size or that is none.
[[nodiscard]] std::string fault(const Camera& camera);

}  // namespace alidade
