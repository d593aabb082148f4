#pragma once

#include <optional>
#include <span>
#include <string>

#include "alidade/board/board.h"
#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/study.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// Another lens model that was tried: it fits where the requested one does not.
struct FittingModel {
  std::string model;
  double rms_px = 0.0;
};

/// The lens model that fits these corners, each tried in turn: RMS at most half of that of the failed solve, and nearly
/// all corners used. For a solve of `config` that did not converge, or whose parameters are undetermined because it
/// does not fit. None if no other model fits either: then the corners, or the board, are doubtful.
[[nodiscard]] std::optional<FittingModel> fitting_model(const Board& board, std::span<const BoardView> views,
                                                        ImageSize size, const CalibrateConfig& config,
                                                        const CalibrateReport& failed);

/// Adds to a failed calibration which model to use, if there is one; otherwise leaves it unchanged.
void advise_fitting_model(const Board& board, std::span<const BoardView> views, ImageSize size,
                          const CalibrateConfig& config, CalibrateReport& report);

/// The option for the model whose held-out error is significantly lowest, "use --model kannala_brandt"; empty if none
/// is significantly better than the one in use.
[[nodiscard]] std::string better_model_advice(const CalibrationStudy& study, const CalibrateConfig& config);

/// The other distortion model, if it fits these corners equally well: no photo refutes what it predicts elsewhere.
struct RivalModel {
  std::string model;
  double weight = 0.0;  ///< Of its fit relative to that of the model in use, by χ², with errors shared within photos.
  double apart_px = 0.0, sigmas = 0.0;           ///< Largest difference over the image, and in units of the stated σ.
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< The pixel where it occurs.
};

/// kannala_brandt for brown, and brown for kannala_brandt. None if it is ruled out (a weight of 1 %), or if the
/// two agree within 3σ over the image.
[[nodiscard]] std::optional<RivalModel> rival_model(const Board& board, std::span<const BoardView> views,
                                                    const CalibrateConfig& config, const CalibrateReport& report);

/// Reports it in the verdict, which becomes `care` at best.
void heed_rival_model(const RivalModel& rival, Verdict& verdict);

}  // namespace alidade
