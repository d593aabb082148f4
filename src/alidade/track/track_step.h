#pragma once

#include <string_view>

#include "alidade/estimation/belief.h"
#include "alidade/estimation/innovation.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// What became of an observation.
enum class TrackEvent {
  none,
  waiting,   ///< No track yet: another head is needed to start it.
  start,     ///< Track begun, by intersecting the rays of two heads.
  restart,   ///< Begun again: the old one did not agree with what was seen.
  gated,     ///< Observation rejected: NIS beyond the gate.
  depth,     ///< Observation rejected: the target would be outside the working range.
  outside,   ///< Observation rejected: its pixel is not in the image, or not a number.
  late,      ///< Observation rejected: older than the history.
  one_head,  ///< Used, but only one head has seen the target for a while: its range is drifting.
  frozen,    ///< Kept out: the row repeats the one before it, because its head's image or encoders stood still.
};
/// "", waiting, start, restart, gated, depth, outside, late, one_head, frozen.
[[nodiscard]] std::string_view event_name(TrackEvent event);

/// What became of one observation. The belief is that of the newest capture time so far, position and velocity in the
/// world.
struct TrackStep {
  double t_s = 0.0;
  bool has_belief = false;
  Belief<6> belief;
  TrackEvent event = TrackEvent::waiting;
  bool accepted = false;
  bool has_innovation = false;
  Innovation innovation;  ///< At the observation's own capture time.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
