#pragma once

#include <string>

#include "alidade/public.h"
#include "alidade/rangefinder.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document and printed lines of a rangefinder; if there is a beam, also rangefinder.yaml and camera.yaml.
/// `camera_file`: the file of the camera, to be named in rangefinder.yaml.
[[nodiscard]] JobOutcome outcome_of(const RangefinderCalibration& calibration, const std::string& camera_file = "");

/// The same for a direction estimated from edges.
[[nodiscard]] JobOutcome outcome_of(const EdgesCalibration& calibration);

/// Adds small images of the shots' photos for the report.
void add_images(const RangefinderCalibration& calibration, const PhotoByName& load_photo, JobOutcome& outcome);

ALIDADE_PUBLIC_END
}  // namespace alidade
