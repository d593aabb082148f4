#pragma once

#include <span>
#include <vector>

#include "alidade/localize/path/path_smoother.h"
#include "alidade/localize/sequence.h"

namespace alidade {

/// After a late restart the filter knows few depths, and a problem contains few points. Adds all others that the
/// smoothed path observes from different directions, with their observations; those of points that no position fits are
/// added, too, and count as rejected. Adds nothing if there would be too many. `frames`: the problem's.
void add_remaining(const SmoothedPath& smoothed, std::span<const ObservationFrame> frames, SmootherProblem& problem);

/// Triangulates those points of a map that were not in the smoothed path (too many at once, or no depth yet) from its
/// poses, in place of the filter's estimate. Covariance: from the pixels, and from the poses as if all of them had one
/// common error. Points observed in fewer than three of the frames, or that do not fit, are not changed. `frames`: in
/// the problem's numbering; `sigma_px`: where an observation has none.
void locate_remaining(const SmoothedPath& smoothed, std::size_t first_frame, std::span<const ObservationFrame> frames,
                      double sigma_px, double gate, std::vector<MapPoint>& map);

}  // namespace alidade
