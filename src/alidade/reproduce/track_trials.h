#pragma once

#include <vector>

#include "alidade/simulate/track.h"
#include "alidade/track/track.h"

namespace alidade::reproduce {

/// The observations of a simulated scene, as the tracker takes them.
[[nodiscard]] std::vector<TargetObservation> observations_of(const TrackScene& scene, std::uint64_t seed);
/// Its truth, each 5 ms.
[[nodiscard]] TrueTrack truth_of(const TrackScene& scene);

}  // namespace alidade::reproduce
