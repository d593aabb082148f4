#pragma once

#include <optional>
#include <span>

#include "alidade/localize/frames/kept_frames.h"
#include "alidade/localize/target.h"

namespace alidade {

/// Observations of known points by a camera that stands still, averaged over thirty intervals. With a pose per frame
/// such a camera appears to move, by pixel noise, and the apparent parallax grows with the number of frames until it
/// outweighs the given data (J. Neyman & E. Scott, "Consistent Estimates Based on Partially Consistent Observations",
/// 1948). σ of each mean is from their scatter, plus motion that noise may hide; depths of other points are
/// undetermined from one place. Empty if there are too few frames, or the observations of all points scatter more than
/// noise.
[[nodiscard]] std::optional<KeptFrames> averaged_still(const KeptFrames& frames, std::span<const KnownPoint> known,
                                                       double sigma_px);

}  // namespace alidade
