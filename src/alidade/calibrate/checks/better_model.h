#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/board/board.h"
#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/study.h"
#include "alidade/estimation/verdict.h"

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

/// The other distorted model where it fits these corners as well: what it shows elsewhere, no photo contradicts.
struct RivalModel {
  std::string model;
  double weight = 0.0;  ///< Of its fit against that of the model in use, by χ² where photos share errors.
  double apart_px = 0.0, sigmas = 0.0;           ///< Where it differs most, in what is stated there.
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< There.
};

/// kannala_brandt for brown, and brown for kannala_brandt. None where it is ruled out (a weight of 1 %), or where the
/// two agree within 3σ over the image.
[[nodiscard]] std::optional<RivalModel> rival_model(const Board& board, std::span<const BoardView> views,
                                                    const CalibrateConfig& config, const CalibrateReport& report);

/// Names it in the verdict, which is of care at best.
void heed_rival_model(const RivalModel& rival, Verdict& verdict);

}  // namespace alidade
