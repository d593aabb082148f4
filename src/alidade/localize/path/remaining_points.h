#pragma once

#include <span>
#include <vector>

#include "alidade/localize/path/path_smoother.h"
#include "alidade/localize/sequence.h"

namespace alidade {

/// The points of a map that had no part in the smoothed path (there were too many at once, or no depth yet): where its
/// poses see them, instead of where the filter left them. Covariance: of the pixels, and of the poses as if all of
/// them had one error. Points that fewer than three of the frames see, or that do not fit, stay as they are. `frames`:
/// those of the problem's numbering; `sigma_px` where an observation does not say.
void locate_remaining(const SmoothedPath& smoothed, std::size_t first_frame, std::span<const ObservationFrame> frames,
                      double sigma_px, double gate, std::vector<MapPoint>& map);

}  // namespace alidade
