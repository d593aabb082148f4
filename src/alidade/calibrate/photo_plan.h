#pragma once

#include "alidade/board/board.h"
#include "alidade/calibrate/calibration.h"
#include "alidade/calibrate/next_photo.h"
#include "alidade/description/field.h"
#include "alidade/estimation/config_error.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A calibrated camera, as plan_photos() needs it.
struct CalibratedNow {
  Camera camera;
  Board board;
  std::vector<Eigen::Vector3d> board_points;  ///< [m] as estimated.
  double noise_px = 0.0;                      ///< σ of a corner's coordinate.
  double design_effect = 1.0;                 ///< Variance of the estimate over that for independent corner errors.
};

struct PhotoConfig {
  int photos = 3;  ///< Number of photos to propose.
};

[[nodiscard]] FieldList fields_of(PhotoConfig& config);

/// The photos to take next: `photos` in order, and the worst 3σ of projection now.
struct PhotoPlan : NextPhotoPlan {
  CalibratedNow now;
  Counts counts;
  Verdict verdict;
};

/// The board poses whose photos lower the uncertainty most, chosen greedily. Throws ConfigError for an invalid config
/// or camera.
[[nodiscard]] PhotoPlan plan_photos(const CalibratedNow& now, const PhotoConfig& config = {},
                                    const Progress& progress = {});

/// The inputs of plan_photos() from a calibration. Throws ConfigError if it has no camera.
[[nodiscard]] CalibratedNow calibrated_now(const Calibration& calibration);

ALIDADE_PUBLIC_END
}  // namespace alidade
