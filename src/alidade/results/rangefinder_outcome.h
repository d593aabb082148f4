#pragma once

#include <string>

#include "alidade/public.h"
#include "alidade/rangefinder.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The document of a rangefinder, its printed lines, and rangefinder.yaml and camera.yaml where there is a beam.
/// `camera_file`: what the camera was read from, to be named in that file.
[[nodiscard]] JobOutcome outcome_of(const RangefinderCalibration& calibration, const std::string& camera_file = "");

/// The same of a direction by edges.
[[nodiscard]] JobOutcome outcome_of(const EdgesCalibration& calibration);

/// Adds small images of the shots' photos for the report.
void add_images(const RangefinderCalibration& calibration, const PhotoByName& load_photo, JobOutcome& outcome);

ALIDADE_PUBLIC_END
}  // namespace alidade
