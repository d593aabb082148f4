#pragma once

#include <optional>

#include "alidade/heads/head_follow.h"

namespace alidade {

/// Of a target whose bearing alone is seen.
inline constexpr double follow_range_m = 1e3;

/// On the squared innovation over its variance, of a follower's filter: a target that turns back stays the same one.
inline constexpr double follow_gate = 1000.0;

/// The job of `servo` with the axes and delays of a follow, and its target's path as it was seen: what the best of its
/// controllers makes of it. None: the target was seen for less than two seconds, or a loop of these axes is unstable.
[[nodiscard]] std::optional<FollowForecast> forecast_of(const HeadFollowing& following, const RigHead& rig_head,
                                                        const HeadFollowConfig& config, const HeadRange& within);

}  // namespace alidade
