#pragma once

#include <vector>

#include "alidade/board/board.h"
#include "alidade/board/board_view.h"
#include "alidade/calibrate/calibration.h"
#include "alidade/calibrate/found_corners.h"
#include "alidade/calibrate/photo_plan.h"
#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/imaging/photos.h"
#include "alidade/public.h"

/// Calibration of a camera by a board: the whole job, as `alidade calibrate` does it. Its result has the camera with
/// its covariance, the poses of the board, what was rejected and why, and a verdict.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// From photos: the corners are found, the camera is solved, the corners are found again with it, and all is solved,
/// studied and judged. Photos that show no board are named in `counts.skipped`. Throws ConfigError for an invalid
/// config or board, Interrupted where `progress` returns false; never for what the photos show.
[[nodiscard]] Calibration calibrate(const Photos& photos, const Board& board, const CalibrateConfig& config = {},
                                    const Progress& progress = {});

/// From corners detected by other means, in images of that size.
[[nodiscard]] Calibration calibrate(std::vector<BoardView> views, const ImageSize& size, const Board& board,
                                    const CalibrateConfig& config = {}, const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
