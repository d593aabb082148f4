#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "alidade/imaging/photos.h"
#include "python/bindings/bindings.h"

namespace alidade::python {

/// Arrays (H, W) or (H, W, 3), uint8 or uint16, C-contiguous, as images that share their pixels and keep them alive.
[[nodiscard]] Photos photos_of(const std::vector<std::string>& names, const std::vector<py::array>& images);

}  // namespace alidade::python
