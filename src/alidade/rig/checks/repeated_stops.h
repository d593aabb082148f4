#pragma once

#include <span>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/pantilt/head_view.h"

namespace alidade {

/// Views, with those of the same stop averaged.
struct AveragedStops {
  std::vector<HeadView> views;         ///< One per stop: the first one, with mean corners and readings.
  std::vector<SkippedInput> repeated;  ///< The other views, each with the one it was averaged with.
  double sigma_within_rad = 0.0;  ///< σ of one reading of an axis about the mean of its stop; 0: none was repeated.
};

/// Several photos of one board by a head at rest share one error of the readings and of the corner detector:
/// n such views, treated as independent, would divide the variance by n. A stop consists of consecutive views of one
/// head and one board, with corners within a pixel of those of the first and readings within 0.1° of its own: a head
/// that returns makes another stop.
[[nodiscard]] AveragedStops averaged_stops(std::span<const HeadView> views);

}  // namespace alidade
