#pragma once

#include <span>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/pantilt/head_view.h"

namespace alidade {

/// Views with those of one stop averaged.
struct AveragedStops {
  std::vector<HeadView> views;         ///< One a stop: the first, with the mean corners and readings.
  std::vector<SkippedInput> repeated;  ///< The others, each with the one that it was averaged with.
  double sigma_within_rad = 0.0;       ///< Of one reading of an axis about its stop's mean; 0: none was repeated.
};

/// A head that stands and takes several photos of one board has one error of its readings and of the corner finder, not
/// several: n such views, counted as independent, would divide the variance by n. A stop is of consecutive views of one
/// head, one board, corners within a pixel of those of its first and readings within 0.1° of its own: a head that comes
/// back makes another.
[[nodiscard]] AveragedStops averaged_stops(std::span<const HeadView> views);

}  // namespace alidade
