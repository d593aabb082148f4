#pragma once

#include "alidade/board/board.h"
#include "alidade/calibrate/calibration.h"
#include "alidade/calibrate/next_photo.h"
#include "alidade/description/field.h"
#include "alidade/estimation/config_error.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// What is known of a calibrated camera now.
struct CalibratedNow {
  Camera camera;
  Board board;
  std::vector<Eigen::Vector3d> board_points;  ///< [m] as solved.
  double noise_px = 0.0;                      ///< Of a corner.
  double design_effect = 1.0;                 ///< Variance over that of independent corner errors.
};

struct PhotoConfig {
  int photos = 3;  ///< How many to propose.
};

[[nodiscard]] FieldList fields_of(PhotoConfig& config);

/// The photos to take next: `photos` in their order, and the worst 3σ of projection now.
struct PhotoPlan : NextPhotoPlan {
  CalibratedNow now;
  Counts counts;
  Verdict verdict;
};

/// The board poses whose photos lower the uncertainty most, one after the other. Throws ConfigError for an invalid
/// config or camera.
[[nodiscard]] PhotoPlan plan_photos(const CalibratedNow& now, const PhotoConfig& config = {},
                                    const Progress& progress = {});

/// The inputs of plan_photos() from a calibration. Throws ConfigError where it has no camera.
[[nodiscard]] CalibratedNow calibrated_now(const Calibration& calibration);

ALIDADE_PUBLIC_END
}  // namespace alidade
