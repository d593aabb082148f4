#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/error_modes.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// The assumptions of a calibration: the board's square, and each fixed lens parameter. The shift of the lens by each
/// is the sensitivity of the optimum, dθ/da = −S_θθ⁻¹ S_θa, S the information of both with the poses eliminated; a
/// wrong square does not shift a central lens. `report` must have converged; `scores`: its view_scores().
///
/// `air`: the lens that was given and fixed (flat_port). If it has a covariance C, C is included in
/// `report.camera.cov`: K C Kᵀ for the estimated parameters, K C for the cross-covariance, K = dθ/da.
[[nodiscard]] std::vector<Assumption> count_assumptions(const Board& board, const CalibrateConfig& config,
                                                        std::span<const BoardView> views,
                                                        std::span<const ViewScore> scores,
                                                        const std::optional<Camera>& air, CalibrateReport& report);

/// One row, "lens.not_tested", for what could shift the lens by 5σ unnoticed in these photos; none if there is nothing.
/// It does not affect the verdict.
[[nodiscard]] std::optional<Assumption> not_tested(std::span<const UnseenMode> unseen, const CalibrateReport& report);

}  // namespace alidade
