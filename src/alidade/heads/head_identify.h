#pragma once

#include <array>
#include <string>

#include "alidade/heads/head_survey.h"
#include "alidade/servo/identify/positioner_fit.h"

namespace alidade {

/// How a head follows its commands: pan and tilt, and what was done to learn it.
struct HeadIdentification {
  std::string url;
  std::array<PositionerLog, 2> logs;
  std::array<PositionerFit, 2> axes;
  double head_time_s = 0.0;
  Eigen::Vector2d low_rad, high_rad;    ///< Where it was allowed to go.
  std::array<bool, 2> at_own_limits{};  ///< An axis' range is the head's own: no option widens it.
  std::string lie;                      ///< Why nothing can be determined; empty: it can.
  std::array<bool, 2> cramped{};        ///< It could not be moved within its range: nothing else is determined.
  ZoomTrial zoom;
  Verdict verdict;
};
inline constexpr std::array<const char*, 2> head_axis_names{"pan", "tilt"};

/// Steps small and large, to both sides, then smaller and smaller ones, the same one again and again, and a chirp; it
/// is asked at most 40 times a second. Ends where it began. Throws InputError, Interrupted: the head stands then.
[[nodiscard]] HeadIdentification identify_head(HeadDevice& device, const HeadRange& range = {},
                                               const Progress& progress = {});

/// The step to whose multiples commands are rounded: where they end, against where they were to end. 0: none is seen.
[[nodiscard]] double command_step(const PositionerLog& log);

/// The verdict on the fits, and what the log did not excite.
[[nodiscard]] Verdict head_verdict(const HeadIdentification& identified);

}  // namespace alidade
