#pragma once

#include <vector>

#include "alidade/beam/shot.h"
#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/imaging/photos.h"
#include "alidade/public.h"
#include "alidade/rangefinder/calibration.h"
#include "alidade/rangefinder/edges.h"
#include "alidade/rangefinder/shot_plan.h"

/// Calibration of a single-point rangefinder mounted beside a camera: the whole job, as `alidade rangefinder` does it.
/// The result contains the beam with its covariance, the camera it refers to, what was rejected and why, and a verdict.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// From readings and what was observed for each: the laser spot; the corners, pose or plane of a board. With
/// `load_photo`, boards and spots are detected in the photos that the shots name; a shot whose photo cannot be used is
/// listed in `unreadable` and `counts.skipped`. The scale of the readings is estimated too where the beam needs it and
/// the shots determine it. Throws ConfigError for an invalid config or camera, Interrupted where `progress` returns
/// false; never because of the contents of the shots.
[[nodiscard]] RangefinderCalibration rangefinder(std::vector<Shot> shots, const Camera& camera,
                                                 const RangefinderConfig& config = {},
                                                 const PhotoByName& load_photo = {}, const Progress& progress = {});

/// Direction of the beam without a target: from a scan by the head that carries both, and one photo. A check, good to
/// a few mrad, not a calibration. Throws ConfigError where the photo does not have the camera's image size.
[[nodiscard]] EdgesCalibration rangefinder_by_edges(const std::vector<ScanRow>& scan, const GreyImage& photo,
                                                    const Camera& camera, const EdgesConfig& config = {},
                                                    const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
