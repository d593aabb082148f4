#pragma once

#include "alidade/turned/turned_fit.h"

namespace alidade {

inline constexpr double parallax_is_seen = 6.0;  ///< Threshold of ParallaxTest::z, above which it is not noise.

/// Tests whether the residuals of a pair of photos lie along the lines to one point, as for a camera whose centre
/// moved. Summed over the matches, the square along such a line minus the square across it has zero mean for isotropic
/// noise of any size, and otherwise the square of the parallax; the point is the one of 200 directions with the largest
/// sum. Directional noise, as along edges, is recognised by its lack of agreement, of neighbours' residuals with each
/// other and of a point's residuals in some photos with those in others; z is limited to the z of that agreement.
[[nodiscard]] ParallaxTest parallax_of(const TurnedFit& fit);

}  // namespace alidade
