#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/track/track.h"

namespace alidade {

/// Rows of heads whose images or encoders were frozen, ordered by head and time: of runs of repeated values
/// longer than chance explains, those of heads whose values otherwise have noise, which does not repeat,
/// and those that the track without them contradicts (rounded values, and those of a head at rest, may
/// repeat).
[[nodiscard]] std::vector<FrozenRows> frozen_rows(std::span<const TargetObservation> observations,
                                                  std::span<const RigHead> heads, const FollowConfig& config);

/// Whether each observation is one of them; empty if there are none.
[[nodiscard]] std::vector<bool> rows_of(std::span<const FrozenRows> frozen,
                                        std::span<const TargetObservation> observations);

/// "the pixels of head 2 are exactly those of the row before in 20 rows from 7.3 to 8.3 s: …".
[[nodiscard]] std::string frozen_text(const FrozenRows& frozen, std::span<const RigHead> heads);

/// "find out why head 2 stood still from 7.3 to 8.3 s: …".
[[nodiscard]] std::string frozen_remedy(const FrozenRows& frozen, std::span<const RigHead> heads);

}  // namespace alidade
