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

/// Intrinsics of a camera that rotates (and zooms), from what it sees meanwhile: the whole job, as `alidade observe`
/// does it. Rows that come one by one: Observer. Where to rotate next: plan_moves().
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// From a log of its rotation and of points that stand still. Throws ConfigError for a config or a log that cannot be,
/// Interrupted where `progress` says stop; never for what the log shows. docs/maths/rotating-camera.md.
[[nodiscard]] ObserveReport observe(RotationLog log, const ObserveConfig& config = {}, const Progress& progress = {});

/// From photos that it took while it was rotated on the spot, by hand say. Of the config method, lever, σ of angles,
/// rates and ranges, and window are of logs; `estimate` is auto, none, k1 or k2. docs/maths/turned-photos.md.
[[nodiscard]] ObserveReport observe(const Photos& photos, const ObserveConfig& config = {},
                                    const Progress& progress = {});

/// From matches between such photos that somebody found, of which many may be wrong.
[[nodiscard]] ObserveReport observe(MatchedPhotos matches, const ObserveConfig& config = {},
                                    const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
