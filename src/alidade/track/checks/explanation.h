#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/track/track.h"

namespace alidade {

struct ClockShift;

/// A mistake under which observations that do not fit the rig would.
struct Explanation {
  std::string what, to_do;
  bool is_foreign_head = false;  ///< One head agrees with none of the others: by its pose, or by its clock.
};

/// Swapped heads, a wrong sign of an angle or a mirrored image, of all heads or of one, degrees, a head that is not
/// the rig's: the one under which the observations fit and are the most probable. Two of them where they are nearly
/// equally probable; none where none lets the observations fit.
[[nodiscard]] std::optional<Explanation> explanation_of(std::span<const TargetObservation> observations,
                                                        std::span<const RigHead> heads, const FollowConfig& config);

/// "the clock of head 2 seems 30 ms behind that of head 1 …"
[[nodiscard]] std::string clock_text(const ClockShift& shift, std::span<const RigHead> heads);

/// Whether most observations of two heads at a time have parallel rays.
[[nodiscard]] bool are_parallel(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                const FollowConfig& config);

/// Why no track began although there were two heads at a time.
[[nodiscard]] Explanation why_no_start(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                       const FollowConfig& config);

}  // namespace alidade
