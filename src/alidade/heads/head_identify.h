#pragma once

#include <array>
#include <string>

#include "alidade/heads/head_survey.h"
#include "alidade/servo/identify/positioner_fit.h"

namespace alidade {

/// Dynamics of a head, pan and tilt, and the moves used to identify them.
struct HeadIdentification {
  std::string url;
  std::array<PositionerLog, 2> logs;
  std::array<PositionerFit, 2> axes;
  double head_time_s = 0.0;
  Eigen::Vector2d low_rad, high_rad;    ///< Range in which it was allowed to move.
  std::array<bool, 2> at_own_limits{};  ///< The range of an axis is limited by the head itself: no option widens it.
  std::string lie;                      ///< Why nothing can be identified; empty: it can.
  std::array<bool, 2> cramped{};        ///< It could not be moved within its range: nothing else is identified.
  ZoomTrial zoom;
  Verdict verdict;
};
inline constexpr std::array<const char*, 2> head_axis_names{"pan", "tilt"};

/// Steps small and large, in both directions, then smaller and smaller ones, repeated ones, and a chirp; it
/// is polled at most 40 times a second. Ends where it began. Throws InputError, Interrupted, with the head stopped.
[[nodiscard]] HeadIdentification identify_head(HeadDevice& device, const HeadRange& range = {},
                                               const Progress& progress = {});

/// Step to whose multiples commands are rounded, from final positions against commanded ones. 0: none is visible.
[[nodiscard]] double command_step(const PositionerLog& log);

/// The verdict on the fits, and on what the log did not excite.
[[nodiscard]] Verdict head_verdict(const HeadIdentification& identified);

}  // namespace alidade
