#pragma once

#include <span>
#include <string>

#include "alidade/track/track.h"

namespace alidade {

/// The lean of one head's innovations that no noise explains, and what usually does it.
struct Lean {
  std::string text;
  double size = 0.0;  ///< In σ; 0: none.
};

/// Means of innovations that are smaller are no lean.
inline constexpr double min_mean_lean = 0.4;

/// The largest lean of all heads.
[[nodiscard]] Lean worst_lean(const TrackReport& report, std::span<const RigHead> heads);

/// NIS a degree of freedom that is good, and that is still a track.
inline constexpr double good_nis_high = 1.5, max_nis = 3.0;

/// How large the innovations are. Smaller noise than what was supposed for want of a σ makes every σ too wide: no
/// doubt.
[[nodiscard]] Check nis_check(const TrackReport& report, bool is_stated);

}  // namespace alidade
