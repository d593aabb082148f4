#pragma once

#include <span>

#include "alidade/estimation/progress.h"
#include "alidade/network/report.h"

namespace alidade {

/// Poses and clocks of static cameras from their observations of one moving target:
/// relative poses of pairs over the clocks' differences, then all cameras and the path (a cubic spline) together by
/// maximum likelihood. The world is the first camera's, or with a true path that path's, brought there by a similarity
/// alone. Readings of a head are what they are throughout (its encoder's zero). Does not throw on bad data: the report
/// says how it went. docs/maths/fixed-cameras.md. Throws Interrupted.
[[nodiscard]] MovingTargetReport place_cameras(std::span<const TargetObservation> observations,
                                               std::span<const RigHead> heads, const MovingTargetConfig& config,
                                               const TrueTrack& truth = {}, const Progress& progress = {});

/// The verdict on the estimate, or why there is none, and what to add.
[[nodiscard]] Verdict moving_target_verdict(const MovingTargetReport& report, const MovingTargetConfig& config);

}  // namespace alidade
