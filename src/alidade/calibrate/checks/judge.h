#pragma once

#include "alidade/calibrate/calibrate_photos.h"
#include "alidade/calibrate/calibration.h"

namespace alidade {

/// Judges a finished solve: studies it, plans the next photo and gives the verdict. A requested board shape
/// that does not transfer from one half of the photos to the other is dropped (`decide_shape`), and the board is solved
/// flat or as a bow; with BoardShape::automatic the transfer test decides. `air`: the lens that `config` fixes
/// (flat_port), whose covariance is then included.
[[nodiscard]] Calibration judge_calibration(const Board& board, PhotoCalibration photos, CalibrateConfig config,
                                            const std::optional<Camera>& air = {}, const Progress& progress = {});

}  // namespace alidade
