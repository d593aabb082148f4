#pragma once

#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/imaging/photos.h"
#include "alidade/matching/matched_photos.h"
#include "alidade/observe/config.h"
#include "alidade/observe/move_plan.h"
#include "alidade/observe/observer.h"
#include "alidade/observe/report.h"
#include "alidade/pantilt/rotation_log.h"
#include "alidade/public.h"

/// Intrinsics of a camera that rotates (and zooms), from its images meanwhile: everything that `alidade observe` does.
/// Observer is the incremental variant, row by row; plan_moves() says where to rotate next.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// From a log of the camera's rotation and of static points. Throws ConfigError for an invalid config or log,
/// Interrupted if `progress` returns false, but never because of what the log shows. docs/maths/rotating-camera.md.
[[nodiscard]] ObserveReport observe(RotationLog log, const ObserveConfig& config = {}, const Progress& progress = {});

/// From photos taken while the camera rotated about its centre, by hand for example. Method, lever, window, and σ of
/// angles, rates and ranges do not apply; `estimate` is auto, none, k1 or k2. docs/maths/turned-photos.md.
[[nodiscard]] ObserveReport observe(const Photos& photos, const ObserveConfig& config = {},
                                    const Progress& progress = {});

/// From given matches between such photos; many of them may be wrong.
[[nodiscard]] ObserveReport observe(MatchedPhotos matches, const ObserveConfig& config = {},
                                    const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
