#pragma once

#include <span>

#include "alidade/localize/localization.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// `residuals`: in the order of frames.
[[nodiscard]] ResidualStructure residual_structure(std::span<const PlacedResidual> residuals, int width_px,
                                                   int height_px);

}  // namespace alidade
