#pragma once

#include "alidade/observe/observe.h"
#include "alidade/results/result_document.h"
#include "alidade/turned/turned.h"

namespace alidade {

/// Photos of a turned camera as a log with a row a photo (its time is its number, its attitude what the photos told),
/// and what they told as an observation of it: so that the page and the files are those of `alidade observe`.
struct TurnedObservation {
  RotationLog log;
  ObserveReport report;
};
[[nodiscard]] TurnedObservation observation_of(const TurnedReport& report, const MatchedPhotos& photos);

/// Fills counts, estimate (with `photos`, `matches`, `parallax`), stddev, covariance and data; also for a refusal.
void fill_turned(const TurnedReport& report, const MatchedPhotos& photos, const TurnedObservation& observation,
                 const Camera& camera, ResultDocument& document);

}  // namespace alidade
