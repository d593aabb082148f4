#pragma once

#include <span>
#include <vector>

#include "alidade/localize/localization.h"

namespace alidade {

/// Where frames of a constant rate are missing though their times say that none is: the camera comes further from one
/// frame to the next than before and after it, in all six components as far as it would have in two, three … periods.
/// Poses around the step are a polynomial of time but for errors of one unknown variance each; by how much a longer
/// step lowers their sum of squares is its likelihood ratio, ν log(S₁/S_m), summed over the components. Where some of
/// every few frames are missing, frame_pattern.h says it. Nothing where frames have no usual period.
struct FoundMissing {
  std::vector<MissingFrames> frames;  ///< In order.
  std::vector<int> pattern;           ///< Steps in periods, again and again; empty: none.
};
[[nodiscard]] FoundMissing missing_frames(std::span<const PathStep> path);

/// Where there are any: the path is right where each frame was taken, and wrong at the times that they bear.
void add_missing(const Localization& report, Verdict& verdict);

}  // namespace alidade
