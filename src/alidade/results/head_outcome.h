#pragma once

#include "alidade/heads/head_calibrate.h"
#include "alidade/heads/head_follow.h"
#include "alidade/heads/head_identify.h"
#include "alidade/results/outcome.h"

namespace alidade {

/// Result document of the survey of a head.
[[nodiscard]] JobOutcome outcome_of(const HeadSurvey& survey);
/// Result document of a head's identification: its axes with σ, and log.csv of each.
[[nodiscard]] JobOutcome outcome_of(const HeadIdentification& identified);
/// Result document of a head's calibration with its camera: camera.yaml, rig.yaml, log.csv.
[[nodiscard]] JobOutcome outcome_of(const HeadCalibration& calibration);
/// Files of a calibration in progress: log.csv, and those of the estimate if there is one.
[[nodiscard]] std::vector<NamedBytes> files_so_far(const HeadCalibration& calibration);
/// Result document of following a target: follow.csv.
[[nodiscard]] JobOutcome outcome_of(const HeadFollowing& following);
[[nodiscard]] std::vector<NamedBytes> files_so_far(const HeadFollowing& following);

}  // namespace alidade
