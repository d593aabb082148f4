#pragma once

#include <map>

#include "alidade/localize/config.h"
#include "alidade/localize/filter.h"
#include "alidade/localize/path_smoother.h"
#include "alidade/localize/point_store.h"

namespace alidade {

/// Where a run began, and when points entered its map: for smoothing the path at the end.
class ObservationRecord {
 public:
  /// The path begins at this frame, for the first time or again.
  void begin(std::size_t frame);
  /// A point that comes back was born when it entered first: its range now is what it said before.
  void entered(std::size_t frame, long id, const RangePrior& prior, bool comes_back) {
    if (!comes_back || !births_.contains(id)) births_[id] = {frame, prior};
  }
  void left(long id) { births_.erase(id); }

  /// All that was seen since the path began, with the filter's map to begin at. Backwards from the last frame, each
  /// pose is the one that explains most of the map's observations: the filter's, that of the frame after it, or one of
  /// the target's alone; so that what a filter took for its pose before it began again is forgotten, and frames before
  /// it began at all are placed as far as the map is seen in them. Points that are not nearly linear yet are rejected:
  /// they tell little, and what they tell is not Gaussian. `gone`: points that left a full filter; their observations
  /// are used, too. None where no known point was seen, or the work would be out
  /// of proportion.
  [[nodiscard]] std::optional<SmootherProblem> problem(const Camera& camera, const LocalizeConfig& config,
                                                       std::span<const ObservationFrame> frames,
                                                       std::span<const PathStep> path, const LocalizationFilter& filter,
                                                       std::span<const GonePoint> gone, double period_s) const;

 private:
  struct Birth {
    std::size_t frame = 0;
    RangePrior range;
  };
  void add_points(const LocalizeConfig& config, const LocalizationFilter& filter, SmootherProblem& problem) const;
  void add_gone(std::span<const GonePoint> gone, SmootherProblem& problem) const;

  std::size_t first_frame_ = 0, num_begun_ = 0;
  std::map<long, Birth> births_;
};

}  // namespace alidade
