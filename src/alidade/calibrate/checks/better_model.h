#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/board/board.h"
#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/study.h"

namespace alidade {

/// Another lens model, tried: it fits where the requested one does not.
struct FittingModel {
  std::string model;
  double rms_px = 0.0;
};

/// The lens model that fits these corners, each tried in turn: RMS at most half of the failed solve's, nearly all
/// corners in use. For a solve of `config` that did not converge, or whose parameters are undetermined because it does
/// not fit. None where no other fits either: then the corners, or the board, are to be doubted.
[[nodiscard]] std::optional<FittingModel> fitting_model(const Board& board, std::span<const BoardView> views,
                                                        ImageSize size, const CalibrateConfig& config,
                                                        const CalibrateReport& failed);

/// Says of a calibration that came to nothing which model to use, where there is one; else leaves it as it is.
void advise_fitting_model(const Board& board, std::span<const BoardView> views, ImageSize size,
                          const CalibrateConfig& config, CalibrateReport& report);

/// What to type for the model whose held-out error is proved the lowest, "use --model kannala_brandt"; empty where none
/// is proved better than the one in use.
[[nodiscard]] std::string better_model_advice(const CalibrationStudy& study, const CalibrateConfig& config);

}  // namespace alidade
