#pragma once

#include <string_view>

#include "alidade/estimation/belief.h"
#include "alidade/estimation/innovation.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// What was done with an observation.
enum class TrackEvent {
  none,
  waiting,   ///< No track yet: an observation by another head is needed to initialise it.
  start,     ///< Track initialised by triangulation from the rays of two heads.
  restart,   ///< Track reinitialised: the old one contradicted the observations.
  gated,     ///< Observation rejected: NIS beyond the gate.
  depth,     ///< Observation rejected: it would place the target outside the working range.
  outside,   ///< Observation rejected: its pixel is outside the image, or not a number.
  late,      ///< Observation rejected: older than the filter's history.
  one_head,  ///< Used, but only one head has seen the target for some time: the range drifts.
  frozen,    ///< Observation excluded: it repeats the previous row, because the head's image or encoders were frozen.
};
/// "", waiting, start, restart, gated, depth, outside, late, one_head, frozen.
[[nodiscard]] std::string_view event_name(TrackEvent event);

/// The result for one observation. The belief is that at the newest capture time so far: position and velocity in the
/// world frame.
struct TrackStep {
  double t_s = 0.0;
  bool has_belief = false;
  Belief<6> belief;
  TrackEvent event = TrackEvent::waiting;
  bool accepted = false;
  bool has_innovation = false;
  Innovation innovation;  ///< At the capture time of this observation.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
