#pragma once

#include "alidade/heads/head_calibrate.h"
#include "alidade/heads/head_follow.h"
#include "alidade/heads/head_identify.h"
#include "alidade/results/outcome.h"

namespace alidade {

/// The document of what a head is.
[[nodiscard]] JobOutcome outcome_of(const HeadSurvey& survey);
/// Of how it follows: its axes with σ, and log.csv of each.
[[nodiscard]] JobOutcome outcome_of(const HeadIdentification& identified);
/// Of what it and its camera show: camera.yaml, rig.yaml, log.csv.
[[nodiscard]] JobOutcome outcome_of(const HeadCalibration& calibration);
/// Its files while it runs: log.csv, and those of the estimate where there is one.
[[nodiscard]] std::vector<NamedBytes> files_so_far(const HeadCalibration& calibration);
/// Of how it followed a target: follow.csv.
[[nodiscard]] JobOutcome outcome_of(const HeadFollowing& following);
[[nodiscard]] std::vector<NamedBytes> files_so_far(const HeadFollowing& following);

}  // namespace alidade
