#pragma once

#include <map>
#include <vector>

#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/imaging/photos.h"
#include "alidade/pantilt/head_cameras.h"
#include "alidade/public.h"
#include "alidade/rig/calibration.h"

/// Calibration of pan-tilt heads: the whole job, as `alidade rig` does it. The result contains axes, offsets and camera
/// mountings with their covariance, the relative poses of the heads, what was rejected and why, and a verdict.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// From views of static boards, each with the head's encoder readings. `cameras`: by head id
/// (cameras_by_head()). With `load_photo` the boards are detected in the photos that the views name; a photo without a
/// board is listed in `counts.skipped`. Throws ConfigError for an invalid config or cameras, and for corners outside
/// their camera's image; Interrupted where `progress` returns false; never because of what the views show.
[[nodiscard]] RigCalibration rig(std::vector<HeadView> views, const std::map<int, Camera>& cameras,
                                 const RigConfig& config, const PhotoByName& load_photo = {},
                                 const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
