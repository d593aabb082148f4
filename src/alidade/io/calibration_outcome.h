#pragma once

#include "alidade/calibrate/calibration.h"
#include "alidade/imaging/find_boards.h"
#include "cli/run.h"

namespace alidade::cli {

/// The lines that a person reads at the end of `alidade calibrate`.
void summarize(const Calibration& calibration, Run& run);

/// camera.yaml, corners.csv, poses.csv and board_points.csv, where there is a camera.
void add_result_files(const Calibration& calibration, Run& run);

/// Small pictures of the photos for the report, and the worst one without its distortion.
void add_pictures(const Calibration& calibration, const PhotoLoader& load_photo, Run& run);

}  // namespace alidade::cli
