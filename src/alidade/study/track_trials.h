#pragma once

#include "alidade/study/studies.h"

// What the studies of track and of a chain share.

namespace alidade {

/// The rig with heads and lenses assumed exact: all covariances zero.
[[nodiscard]] Rig as_exact(Rig rig);

/// Follows the target, and compares where it is at the end with the trial's truth.
void take_end_of_track(const TrackTrial& trial, TrialResult& result);

}  // namespace alidade
