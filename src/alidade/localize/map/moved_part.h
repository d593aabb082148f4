#pragma once

#include <span>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// Tests whether some of a target's points have moved relative to the others, by their estimated positions in a
/// path's map. The mean of a part is certain even where single points are not: score test of a shift of each compact
/// half, quarter and eighth, with a similarity of all points free. For parts that are mixed among each other, the
/// largest eigenvalue of the points' covariance, against that of noise (I. M. Johnstone, "On the Distribution of the
/// Largest Eigenvalue in Principal Components Analysis", Annals of Statistics 29, 2001). No test below twelve
/// points.
[[nodiscard]] MovedPart moved_part(std::span<const MapPoint> map, std::span<const KnownPoint> given);

}  // namespace alidade
