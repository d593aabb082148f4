#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>

#include "alidade/localize/localization.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// `residuals`: in order of frames. If errors are autocorrelated, those of a point are one cluster: the variance of a
/// mean is that of the points' sums, and a mean of few points is not used.
[[nodiscard]] ResidualStructure residual_structure(std::span<const PlacedResidual> residuals, const Camera& camera);

/// Changes of a residual [px] by 1σ errors of the lens, with path and map following: one column per independent error.
using ResidualMoves = std::function<Eigen::Matrix2Xd(const PlacedResidual&)>;

/// The same for the radial component in rings about the image centre. `lasts`: errors are autocorrelated. Effects of a
/// lens within its covariance (`moves`; empty: it is exact) count as chance.
[[nodiscard]] RadialStructure radial_structure(std::span<const PlacedResidual> residuals, const Camera& camera,
                                               bool lasts, const ResidualMoves& moves = {});

}  // namespace alidade
