#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/track/track.h"

namespace alidade {

/// Rows in which a head sees another object than in its other rows.
struct OtherObject {
  std::size_t head = 0, num = 0;
  double from_s = 0.0, until_s = 0.0;
  bool is_to_an_end = false;  ///< Until the end of the log, or from its beginning: the head itself may have been moved.
  double jump_rad = 0.0;      ///< Jump of the head's ray at their beginning or end, the larger one.
  double moved_in_sigma = 0.0;  ///< Deviation of the track there from that without them, in σ.
};

/// The head's ray jumps, and jumps again (or the log begins or ends there), and without the rows in between the others
/// fit one track and this rig, while they do not with them: the smallest such set of rows. None otherwise.
[[nodiscard]] std::optional<OtherObject> other_object(std::span<const TargetObservation> observations,
                                                      std::span<const RigHead> heads, const FollowConfig& config,
                                                      const TrackReport& report);

/// "head 2 sees another object from 7.3 to 10.3 s: …", and "leave out the rows of head 2 from 7.3 to 10.3 s".
[[nodiscard]] std::string other_object_text(const OtherObject& other, std::span<const RigHead> heads);
[[nodiscard]] std::string other_object_remedy(const OtherObject& other, std::span<const RigHead> heads);

}  // namespace alidade
