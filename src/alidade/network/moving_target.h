#pragma once

#include <span>

#include "alidade/estimation/progress.h"
#include "alidade/network/report.h"

namespace alidade {

/// Poses and clocks of static cameras from their observations of one moving target:
/// relative poses of pairs for all clock offsets, then all cameras and the path (a cubic spline) jointly by
/// maximum likelihood. The world is the first camera's, or with a true path that path's, registered by a similarity
/// only. Readings of a head are constant (its encoder's zero). Does not throw because of bad data: see the status of
/// the report. docs/maths/fixed-cameras.md. Throws Interrupted.
[[nodiscard]] MovingTargetReport place_cameras(std::span<const TargetObservation> observations,
                                               std::span<const RigHead> heads, const MovingTargetConfig& config,
                                               const TrueTrack& truth = {}, const Progress& progress = {});

/// The verdict on the estimate, or why there is none, and what to add.
[[nodiscard]] Verdict moving_target_verdict(const MovingTargetReport& report, const MovingTargetConfig& config);

}  // namespace alidade
