#pragma once

#include <span>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// Whether some of the points of a target are elsewhere than given against the others, by where a path's map has them.
/// What σ per point leaves of a part's mean is small, where that of all points together says nothing: the score of a
/// shift of each half, quarter and eighth of them that lie together, all points following a similarity. Of parts that
/// lie among each other the largest eigenvalue of the points' covariance, against those of noise (I. M. Johnstone, "On
/// the Distribution of the Largest Eigenvalue in Principal Components Analysis", Annals of Statistics 29, 2001). Of
/// fewer than twelve points: nothing.
[[nodiscard]] MovedPart moved_part(std::span<const MapPoint> map, std::span<const KnownPoint> given);

}  // namespace alidade
