#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/track/track.h"

namespace alidade {

/// Rows of a head that are of another object than its others.
struct OtherObject {
  std::size_t head = 0, num = 0;
  double from_s = 0.0, until_s = 0.0;
  bool is_to_an_end = false;    ///< Of the log: the head itself may have been moved there.
  double jump_rad = 0.0;        ///< Of the head's ray where they begin or end, the larger one.
  double moved_in_sigma = 0.0;  ///< How far the track is off there, by what it is without them.
};

/// The head's ray jumps, and jumps again (or the log begins or ends there), and without the rows between the others
/// around fit one track and this rig, which they do not with them: of such rows the fewest. None otherwise.
[[nodiscard]] std::optional<OtherObject> other_object(std::span<const TargetObservation> observations,
                                                      std::span<const RigHead> heads, const FollowConfig& config,
                                                      const TrackReport& report);

/// "head 2 sees another object from 7.3 to 10.3 s: …", and "leave out the rows of head 2 from 7.3 to 10.3 s".
[[nodiscard]] std::string other_object_text(const OtherObject& other, std::span<const RigHead> heads);
[[nodiscard]] std::string other_object_remedy(const OtherObject& other, std::span<const RigHead> heads);

}  // namespace alidade
