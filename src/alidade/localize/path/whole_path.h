#pragma once

#include <functional>
#include <map>
#include <vector>

#include "alidade/localize/engine.h"
#include "alidade/localize/filter/observation_record.h"
#include "alidade/localize/frames/kept_frames.h"

namespace alidade {

/// What a front end has kept of a recording, to solve its path again from all of it.
struct Recording {
  const ObservationRecord& record;
  const KeptFrames& frames;
  std::vector<GonePoint> gone;                        ///< Points that left the filter.
  std::map<long, long> number_of = {};                ///< Of points seen again long after: whose (point_episodes.h).
  double period_s = 1.0 / 30.0;                       ///< Usual time between frames.
  std::function<std::size_t(long id)> num_used = {};  ///< How often a point was used.
};

/// The path from all frames together, its loops closed, in metres where sensors say them.
struct WholePath {
  SmoothedPath smoothed;
  std::size_t first_frame = 0;  ///< Of those kept.
  double scale = 1.0;           ///< What the filter's unit of length is now.
};

/// `config` as resolved() gives it, its target as the filter was given it. `result` has the filter's path, which is
/// replaced. None, and no change, where it does not settle.
[[nodiscard]] std::optional<WholePath> whole_path(const Recording& recording, const LocalizeEngine& engine,
                                                  const LocalizeConfig& config, Localization& result);

/// How often the filter was reinitialised where hardly a point fits the smoothed path on both sides: what is before it
/// may then be anywhere. Residuals in order of their frames, of which the first is the path's `first_frame`.
[[nodiscard]] std::size_t num_untied(std::span<const PlacedResidual> residuals, std::size_t first_frame,
                                     std::span<const PathStep> path);

/// The map as that path sees it, with the points that left the filter. `result` has the filter's map.
void take_over(const std::optional<WholePath>& whole, const Recording& recording, const LocalizeEngine& engine,
               const LocalizeConfig& config, Localization& result);

}  // namespace alidade
