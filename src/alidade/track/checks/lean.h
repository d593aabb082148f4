#pragma once

#include <span>
#include <string>

#include "alidade/track/track.h"

namespace alidade {

/// A bias of one head's innovations that no noise explains, and its usual cause.
struct Lean {
  std::string text;
  double size = 0.0;  ///< In σ; 0: none.
};

/// Means of innovations below this are not a bias.
inline constexpr double min_mean_lean = 0.4;

/// The largest bias of all heads.
[[nodiscard]] Lean worst_lean(const TrackReport& report, std::span<const RigHead> heads);

/// NIS per degree of freedom: limits of a good track, and of an acceptable one.
inline constexpr double good_nis_high = 1.5, max_nis = 3.0;

/// The size of the innovations. Noise smaller than the default assumed without a σ only makes every σ too large: no
/// reason for doubt.
[[nodiscard]] Check nis_check(const TrackReport& report, bool is_stated);

}  // namespace alidade
