#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/error_modes.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// The assumptions of a calibration: the board's square, and each fixed lens parameter. How far each would move
/// the lens is the linearised optimum's dθ/da = −S_θθ⁻¹ S_θa, S the information of both with the poses eliminated; a
/// square that is off moves a central lens by nothing. `report` must have converged; `scores`: its view_scores().
///
/// `air`: the lens that was given and fixed (flat_port). Where it has a covariance C, C is included in
/// `report.camera.cov`: K C Kᵀ on what was estimated, K C between, K = dθ/da.
[[nodiscard]] std::vector<Assumption> count_assumptions(const Board& board, const CalibrateConfig& config,
                                                        std::span<const BoardView> views,
                                                        std::span<const ViewScore> scores,
                                                        const std::optional<Camera>& air, CalibrateReport& report);

/// One row, "lens.not_tested", for what would move the lens by 5σ without showing in these photos; none where there is
/// nothing. It has no say in the verdict.
[[nodiscard]] std::optional<Assumption> not_tested(std::span<const UnseenMode> unseen, const CalibrateReport& report);

}  // namespace alidade
