#pragma once

#include "alidade/calibrate/found_corners.h"
#include "alidade/images/photo_set.h"
#include "alidade/imaging/photos.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The document of a calibration, its printed lines, and camera.yaml, corners.csv, poses.csv and board_points.csv
/// where there is a camera.
[[nodiscard]] JobOutcome outcome_of(const Calibration& calibration);

/// The document of corners, its lines, and corners.csv where there are any.
[[nodiscard]] JobOutcome outcome_of(const FoundCorners& found);

/// Adds what became of the photos' files: the inputs, other files beside the photos, and their orientation.
void add_photos(const PhotoSet& set, JobOutcome& outcome);

/// Adds small images of the photos for the report, and the worst one without its distortion.
void add_images(const Calibration& calibration, const Photos& photos, JobOutcome& outcome);

ALIDADE_PUBLIC_END
}  // namespace alidade
