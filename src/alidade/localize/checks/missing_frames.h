#pragma once

#include <span>
#include <vector>

#include "alidade/localize/localization.h"

namespace alidade {

/// Missing frames of a constant rate, although the times claim that there are none: the camera moves further between
/// two frames than before and after, in all six components by as much as in two, three … periods. Model: poses around
/// the step are a polynomial of time, with errors of one unknown variance per component; the likelihood ratio of a
/// longer step is ν log(S₁/S_m), summed over the components. If some of every few frames are missing, frame_pattern.h
/// detects it. Empty if frames have no usual period.
struct FoundMissing {
  std::vector<MissingFrames> frames;  ///< In order of time.
  std::vector<int> pattern;           ///< Repeating steps in periods; empty: none.
};
[[nodiscard]] FoundMissing missing_frames(std::span<const PathStep> path);

/// Reports missing frames: the path is right at the true times of the frames, and wrong at the given ones.
void add_missing(const Localization& report, Verdict& verdict);

}  // namespace alidade
