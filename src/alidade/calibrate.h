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

/// Calibration of a camera from photos of a board: the whole job, as `alidade calibrate` does it. The result contains
/// the camera with its covariance, the poses of the board, what was rejected and why, and a verdict.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// From photos: detects the corners, estimates the camera, detects the corners again with it, estimates all again,
/// and judges the result. Photos that show no board are listed in `counts.skipped`. Throws ConfigError
/// for an invalid config or board, Interrupted where `progress` returns false; never because of what the photos show.
[[nodiscard]] Calibration calibrate(const Photos& photos, const Board& board, const CalibrateConfig& config = {},
                                    const Progress& progress = {});

/// From corners that were detected by other means, in images of size `size`.
[[nodiscard]] Calibration calibrate(std::vector<BoardView> views, const ImageSize& size, const Board& board,
                                    const CalibrateConfig& config = {}, const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
