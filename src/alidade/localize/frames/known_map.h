#pragma once

#include <vector>

#include "alidade/localize/saved_map.h"
#include "alidade/localize/target.h"

namespace alidade {

/// Maximum number of points of a saved map in the filter at once.
inline constexpr std::size_t max_saved_at_once = 60;

/// The points of a map as known points, each with the σ of its least certain direction; without those that are far less
/// certain than most.
[[nodiscard]] std::vector<KnownPoint> known_points(const SavedMap& map);

}  // namespace alidade
