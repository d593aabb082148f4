#pragma once

#include <span>
#include <vector>

#include "alidade/localize/path/path_smoother.h"
#include "alidade/localize/sequence.h"

namespace alidade {

/// Where the filter began again late it knows few depths, and a problem has few points. All others that the smoothed
/// path sees from different directions, with their observations; those of points that no position fits are in it, too,
/// and count as rejected. None, where there would be too many. `frames`: the problem's.
void add_remaining(const SmoothedPath& smoothed, std::span<const ObservationFrame> frames, SmootherProblem& problem);

/// The points of a map that had no part in the smoothed path (there were too many at once, or no depth yet): where its
/// poses see them, instead of where the filter left them. Covariance: of the pixels, and of the poses as if all of
/// them had one error. Points that fewer than three of the frames see, or that do not fit, stay as they are. `frames`:
/// those of the problem's numbering; `sigma_px` where an observation does not say.
void locate_remaining(const SmoothedPath& smoothed, std::size_t first_frame, std::span<const ObservationFrame> frames,
                      double sigma_px, double gate, std::vector<MapPoint>& map);

}  // namespace alidade
