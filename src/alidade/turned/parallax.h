#pragma once

#include "alidade/turned/turned_fit.h"

namespace alidade {

inline constexpr double parallax_is_seen = 6.0;  ///< Of ParallaxTest::z: what is above is no noise.

/// Do the residuals of a pair of photos lie along the lines to one point, as those of a camera whose centre moved?
/// Summed over the matches, the square along such a line less the square across it is zero in the mean for noise of any
/// size that knows no direction, and the parallax' square else; the point is the one of 200 directions that shows most.
/// Noise that has a direction, as along edges, is told from it by what agrees with nothing: neither neighbours' misfits
/// with each other nor a point's in some photos with those in others; z is then no larger than that agreement's.
[[nodiscard]] ParallaxTest parallax_of(const TurnedFit& fit);

}  // namespace alidade
