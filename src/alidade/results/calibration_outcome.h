#pragma once

#include "alidade/calibrate/found_corners.h"
#include "alidade/images/photo_set.h"
#include "alidade/imaging/photos.h"
#include "alidade/public.h"
#include "alidade/results/outcome.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Result document and printed lines of a calibration; if there is a camera, also camera.yaml, corners.csv, poses.csv
/// and board_points.csv.
[[nodiscard]] JobOutcome outcome_of(const Calibration& calibration);

/// Result document and printed lines of detected corners, and corners.csv if there are any.
[[nodiscard]] JobOutcome outcome_of(const FoundCorners& found);

/// Adds the files of the photos: the inputs, other files beside the photos, and the photos' orientation.
void add_photos(const PhotoSet& set, JobOutcome& outcome);

/// Adds small images of the photos for the report, and the worst photo undistorted.
void add_images(const Calibration& calibration, const Photos& photos, JobOutcome& outcome);

ALIDADE_PUBLIC_END
}  // namespace alidade
