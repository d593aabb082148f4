#pragma once

#include <span>

#include "alidade/board/board_view.h"
#include "alidade/calibrate/next_photo.h"
#include "alidade/calibrate/study.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// The verdict on a calibration, one sentence and its checks: coverage, lens adequate, consistent, honest corners,
/// board flat, principal point. Every number in the text is taken from `study` and `report`. Corners without a
/// covariance are judged by the tails of their residuals only.
[[nodiscard]] Verdict calibration_verdict(const CalibrateReport& report, const CalibrationStudy& study,
                                          std::span<const BoardView> views, const CalibrateConfig& config,
                                          const NextPhotoPlan& next);

/// The verdict on a calibration that was refused or did not converge: exit code 4 or 5, what cannot be determined, and
/// what to add.
[[nodiscard]] Verdict refusal_verdict(const CalibrateReport& report);

}  // namespace alidade
