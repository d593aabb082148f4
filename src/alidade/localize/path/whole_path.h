#pragma once

#include <functional>
#include <map>
#include <vector>

#include "alidade/localize/engine.h"
#include "alidade/localize/filter/observation_record.h"
#include "alidade/localize/frames/kept_frames.h"

namespace alidade {

/// The data of a recording that a front end keeps to solve the whole path again.
struct Recording {
  const ObservationRecord& record;
  const KeptFrames& frames;
  std::vector<GonePoint> gone;                        ///< Points that left the filter.
  std::map<long, long> number_of = {};                ///< Of points seen again: own number (point_episodes.h).
  double period_s = 1.0 / 30.0;                       ///< Usual time between frames.
  std::function<std::size_t(long id)> num_used = {};  ///< How often a point was used.
};

/// The path from all frames together, with closed loops, in metres if sensors provide them.
struct WholePath {
  SmoothedPath smoothed;
  std::size_t first_frame = 0;  ///< Index among the kept frames.
  double scale = 1.0;           ///< New length of the filter's unit of length.
};

/// `config` as returned by resolved(), with the target as given to the filter. Replaces the filter's path in `result`.
/// Empty, without any change, if it does not converge.
[[nodiscard]] std::optional<WholePath> whole_path(const Recording& recording, const LocalizeEngine& engine,
                                                  const LocalizeConfig& config, Localization& result);

/// Number of restarts of the filter across which hardly any point fits the smoothed path on both sides: the part before
/// may then be anywhere. Residuals in order of frames; the first frame is the path's `first_frame`.
[[nodiscard]] std::size_t num_untied(std::span<const PlacedResidual> residuals, std::size_t first_frame,
                                     std::span<const PathStep> path);

/// The map as seen by that path, including points that left the filter. `result` contains the filter's map.
void take_over(const std::optional<WholePath>& whole, const Recording& recording, const LocalizeEngine& engine,
               const LocalizeConfig& config, Localization& result);

}  // namespace alidade
