#pragma once

#include <span>
#include <vector>

#include "alidade/beam/shot.h"
#include "alidade/estimation/counts.h"

namespace alidade {

/// Shots, with those of the same placement of the board averaged.
struct AveragedShots {
  std::vector<Shot> shots;             ///< One per placement: the first one, with mean reading, spot and corners.
  std::vector<std::size_t> first;      ///< Index of each among the given shots.
  std::vector<SkippedInput> repeated;  ///< The other shots, each with the one it was averaged with.
};

/// Whether a shot belongs to the placement of another: see averaged_shots().
[[nodiscard]] bool at_one_placement(const Shot& first, const Shot& shot);

/// Several readings of an unmoved board share one error of its corners, of the spot and of the instrument at that
/// range: n such shots, treated as independent, would divide the variance by n. One placement: consecutive shots with a
/// board whose corners (pose, plane) and spot are within a pixel (1 mm, 1 mrad) of those of the first, and readings
/// within 5 mm, or 0.5 %, of its own.
[[nodiscard]] AveragedShots averaged_shots(std::span<const Shot> shots);

}  // namespace alidade
