#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// The points of a map that are no longer where it has them: a scene of which a part was moved since.
struct MovedMapPoints {
  std::vector<long> ids;
  std::vector<Eigen::Vector3d> places;  ///< As the map has them.
  std::size_t num_judged = 0;           ///< Of the map's points, that were seen often enough.
  std::size_t num_as_one = 0;           ///< Of those moved, so many fit each other as the map has them: moved as one.
};

/// Which frames agree on, each for itself: in each the pose that most of the map's points fit (of drawn sets of three),
/// and what does not fit it. None have moved, or too few fit to say: empty ids.
[[nodiscard]] MovedMapPoints moved_map_points(const Camera& camera, std::span<const ObservationFrame> frames,
                                              const SavedMap& map, double sigma_px);

}  // namespace alidade
