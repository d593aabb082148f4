#pragma once

#include <span>
#include <vector>

#include "alidade/beam/shot.h"
#include "alidade/estimation/counts.h"

namespace alidade {

/// Shots with those of one placement of the board averaged.
struct AveragedShots {
  std::vector<Shot> shots;             ///< One a placement: the first, with the mean reading, spot and corners.
  std::vector<std::size_t> first;      ///< Position of each among those given.
  std::vector<SkippedInput> repeated;  ///< The others, each with the one that it was averaged with.
};

/// Whether a shot is of the placement of another: see averaged_shots().
[[nodiscard]] bool at_one_placement(const Shot& first, const Shot& shot);

/// A board that stands for several readings has one error of its corners, of the spot and of the instrument at that
/// range, not several: n such shots, counted as independent, would divide the variance by n. One placement: consecutive
/// shots with a board whose corners (pose, plane) and spot are within a pixel (1 mm, 1 mrad) of those of the first, and
/// readings within 5 mm, or 0.5 %, of its own.
[[nodiscard]] AveragedShots averaged_shots(std::span<const Shot> shots);

}  // namespace alidade
