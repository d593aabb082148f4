#pragma once

#include <map>
#include <vector>

#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/network/report.h"
#include "alidade/pantilt/head_cameras.h"
#include "alidade/public.h"

/// Poses of static cameras from one moving target: the whole job, as `alidade rig --moving-target` does it.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Estimates position, attitude and clock of each camera of `heads` (heads_with()) from observations of the target.
/// `truth`: the target's path from another source; empty: none. Throws ConfigError for an invalid config, heads or
/// observations, Interrupted where `progress` returns false; never because of what the observations show.
[[nodiscard]] NetworkCalibration network(std::vector<TargetObservation> observations, const std::vector<RigHead>& heads,
                                         const MovingTargetConfig& config, const TrueTrack& truth = {},
                                         const Progress& progress = {});

/// A rig of the located heads only, with their part of the covariance.
[[nodiscard]] Rig located_rig(const MovingTargetReport& report);

/// The part of a covariance of all heads, ordered as rig.cov, that belongs to the located heads.
[[nodiscard]] Eigen::MatrixXd located_part(const MovingTargetReport& report, const Eigen::MatrixXd& of_all);

/// The observations by located cameras in rig time, in chronological order: the input of `alidade track`.
[[nodiscard]] std::vector<TargetObservation> observations_on_one_clock(const NetworkCalibration& calibration);

ALIDADE_PUBLIC_END
}  // namespace alidade
