#pragma once

#include <map>

#include "alidade/localize/localize.h"
#include "alidade/localize/path_smoother.h"

namespace alidade {

/// What a run used of its sights, and when points entered the map: for smoothing the path at the end.
class SightRecord {
 public:
  /// The path begins at this frame, for the first time or anew: what was before is forgotten.
  void begin(std::size_t frame);
  void take(std::size_t frame, std::span<const FeatureSight> sights, std::span<const SightOutcome> outcomes,
            double sigma_px);
  void entered(std::size_t frame, const FeatureSight& sight, const RangePrior& prior, double sigma_px);
  void left(long id) { births_.erase(id); }

  /// All that was seen since the path began, with the filter's path and map to begin at. Points that are not nearly
  /// linear yet are left out: they tell little, and what they tell is not Gaussian. None where no known point was used,
  /// or the work would be out of proportion.
  [[nodiscard]] std::optional<SmootherProblem> problem(const Camera& camera, const LocalizeConfig& config,
                                                       std::span<const PathStep> path, const LocalizationFilter& filter,
                                                       double period_s) const;
  [[nodiscard]] std::size_t first_frame() const { return first_frame_; }

 private:
  struct Birth {
    std::size_t frame = 0;
    RangePrior range;
  };
  std::size_t first_frame_ = 0, num_begun_ = 0;
  std::vector<UsedSight> used_;  ///< Frames counted from the recording's first.
  std::map<long, Birth> births_;
};

}  // namespace alidade
