#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>

#include "alidade/localize/localization.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// `residuals`: in the order of frames. Where errors last from frame to frame, those of a point count as one: the
/// variance of a mean is that of the points' sums, and a mean of few points says nothing.
[[nodiscard]] ResidualStructure residual_structure(std::span<const PlacedResidual> residuals, const Camera& camera);

/// By how much a residual changes [px] where the lens is off by σ, path and map following: by independent columns.
using ResidualMoves = std::function<Eigen::Matrix2Xd(const PlacedResidual&)>;

/// The same in rings about the image centre, of what is off outward or inward. `lasts`: errors do. What a lens within
/// its covariance leaves is chance (`moves`; none: it is exact).
[[nodiscard]] RadialStructure radial_structure(std::span<const PlacedResidual> residuals, const Camera& camera,
                                               bool lasts, const ResidualMoves& moves = {});

}  // namespace alidade
