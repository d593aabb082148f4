#pragma once

#include <optional>

#include "alidade/heads/head_follow.h"

namespace alidade {

/// For a target of which only the bearing is observed.
inline constexpr double follow_range_m = 1e3;

/// On the squared innovation over its variance, for a follower's filter: a target that reverses remains the same.
inline constexpr double follow_gate = 1000.0;

/// The job of `servo` with the axes and delays of a follow, and the observed path of its target: the result of the best
/// of its controllers. None: the target was visible for less than two seconds, or a loop of these axes is unstable.
[[nodiscard]] std::optional<FollowForecast> forecast_of(const HeadFollowing& following, const RigHead& rig_head,
                                                        const HeadFollowConfig& config, const HeadRange& within);

}  // namespace alidade
