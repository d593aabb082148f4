#pragma once

#include <optional>
#include <span>

#include "alidade/track/track.h"

namespace alidade {

/// The head whose pictures were taken later or earlier than they say, against the first head: a wrong clock passes for
/// a lively target, whose σ_a is then found too large.
struct ClockShift {
  std::size_t head = 0;
  double later_s = 0.0;  ///< To be added to its capture times.
};

/// None where no shift of up to 0.1 s makes the innovations more probable by far.
[[nodiscard]] std::optional<ClockShift> probable_clock_shift(std::span<const TargetSight> sights,
                                                             std::span<const RigHead> heads, const TrackConfig& config);

}  // namespace alidade
