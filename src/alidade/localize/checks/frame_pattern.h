#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "alidade/geometry/rigid3.h"

namespace alidade {

/// A pose in a table of frames.
struct NumberedPose {
  std::size_t number = 0;  ///< Index among all frames of the table, including those without a pose.
  double t_periods = 0.0;  ///< Its time as given, in frame periods.
  Rigid3 world_from_cam;
};

/// Repeating pattern of periods from each frame to the next (1, 2: every third frame is missing), although the times
/// claim that all steps are equal. Empty if there is no clear pattern.
///
/// A score test: if all frames of one phase of a pattern were late by δ, their poses would deviate from a polynomial of
/// the given times by δ ẋ, with alternating signs that no motion has. Windows of frames give δ of each phase, for 2 to
/// 8 phases, with a variance from the scatter between windows; so they give how much each pattern of whole periods
/// explains. Smoothing by a motion model reduces δ, but keeps the pattern.
[[nodiscard]] std::vector<int> frame_pattern(std::span<const NumberedPose> poses);

}  // namespace alidade
