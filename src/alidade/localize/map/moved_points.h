#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// Points of a map that are no longer at their mapped position: part of the scene was moved since.
struct MovedMapPoints {
  std::vector<long> ids;
  std::vector<Eigen::Vector3d> places;  ///< Their positions in the map.
  std::size_t num_judged = 0;           ///< Points of the map that were seen often enough.
  std::size_t num_as_one = 0;           ///< Moved points that still fit each other as mapped: moved as one body.
};

/// Each frame is judged independently: the pose that most of the map's points fit (RANSAC over triples), and the points
/// that do not fit it. Empty ids: none have moved, or too few fit to decide.
[[nodiscard]] MovedMapPoints moved_map_points(const Camera& camera, std::span<const ObservationFrame> frames,
                                              const SavedMap& map, double sigma_px);

}  // namespace alidade
