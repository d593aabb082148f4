#pragma once

#include <span>

#include "alidade/localize/localization.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// `residuals`: in the order of frames. Where errors last from frame to frame, those of a point count as one: the
/// variance of a mean is that of the points' sums, and a mean of few points says nothing.
[[nodiscard]] ResidualStructure residual_structure(std::span<const PlacedResidual> residuals, const Camera& camera);

/// The same in rings about the image centre, of what is off outward or inward. `lasts`: errors do.
[[nodiscard]] RadialStructure radial_structure(std::span<const PlacedResidual> residuals, const Camera& camera,
                                               bool lasts);

}  // namespace alidade
