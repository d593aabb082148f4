#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "alidade/geometry/rigid3.h"

namespace alidade {

/// A pose of a table of frames.
struct NumberedPose {
  std::size_t number = 0;  ///< Of all frames of the table, those without a pose too.
  double t_periods = 0.0;  ///< Its time as given, in periods of the frames.
  Rigid3 world_from_cam;
};

/// In how many periods the camera came from each frame to the next, again and again (1, 2: every third frame is
/// missing), though times say that all steps are alike. Empty where no such pattern is clear.
///
/// A score test: were the times of all frames of one phase of a pattern late by δ, their poses would be off a
/// polynomial of the times that are given by δ ẋ, with alternating signs that no motion has. Over windows of frames
/// this says which δ each phase of 2 to 8 frames has, with its variance by the scatter between windows, and with it how
/// much each pattern of whole periods explains. Smoothing by a motion model makes δ smaller, and leaves its shape.
[[nodiscard]] std::vector<int> frame_pattern(std::span<const NumberedPose> poses);

}  // namespace alidade
