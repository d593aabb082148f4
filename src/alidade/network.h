#pragma once

#include <map>
#include <vector>

#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/network/report.h"
#include "alidade/pantilt/head_cameras.h"
#include "alidade/public.h"

/// Static cameras, located by one target that moves: the whole job, as `alidade rig --moving-target` does it.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Positions, attitudes and clocks of the cameras of `heads` (heads_with()), from their observations of the target.
/// `truth`: the target's path by other means; empty: none. Throws ConfigError for an invalid config, heads or
/// observations, Interrupted where `progress` returns false; never for what the observations show.
[[nodiscard]] NetworkCalibration network(std::vector<TargetObservation> observations, const std::vector<RigHead>& heads,
                                         const MovingTargetConfig& config, const TrueTrack& truth = {},
                                         const Progress& progress = {});

/// The located heads alone, with their part of the covariance.
[[nodiscard]] Rig located_rig(const MovingTargetReport& report);

/// Of a covariance of all heads, as rig.cov, the part of those that were located.
[[nodiscard]] Eigen::MatrixXd located_part(const MovingTargetReport& report, const Eigen::MatrixXd& of_all);

/// The observations of the located cameras on the rig's one clock, in order of time: what `alidade track` reads.
[[nodiscard]] std::vector<TargetObservation> observations_on_one_clock(const NetworkCalibration& calibration);

ALIDADE_PUBLIC_END
}  // namespace alidade
