#pragma once

#include <optional>
#include <span>

#include "alidade/localize/frames/kept_frames.h"
#include "alidade/localize/target.h"

namespace alidade {

/// What a camera that stands still sees of known points, averaged over thirty stretches of time. By poses of its own
/// for each frame such a camera seems to move, as far as pixels' noise does, and what seems a parallax then grows with
/// the number of frames until it outweighs all that is given (J. Neyman & E. Scott, "Consistent Estimates Based on
/// Partially Consistent Observations", 1948). Each mean has the σ by which it scatters, and what a motion that the
/// noise hides may add; of other points nothing says from one place how deep they are. None where there are too few
/// frames, or the observations of all points scatter more than noise does.
[[nodiscard]] std::optional<KeptFrames> averaged_still(const KeptFrames& frames, std::span<const KnownPoint> known,
                                                       double sigma_px);

}  // namespace alidade
