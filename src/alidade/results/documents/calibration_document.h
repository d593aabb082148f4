#pragma once

#include "alidade/board/board.h"
#include "alidade/calibrate/calibration.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Fills counts, estimate, stddev, covariance, data tables and grids of `document` from a calibration, with the
/// documented names for `calibrate`; for a refusal, as far as available.
void fill_calibration(const Board& board, const Calibration& calibration, ResultDocument& document);

/// Table `next`: proposed poses and their benefit.
[[nodiscard]] DataTable next_photos_table(const NextPhotoPlan& plan);

/// Table `points_in_board`: x_m, y_m, z_m of a board's points in its own frame, for drawing.
[[nodiscard]] DataTable points_in_board_table(const std::vector<Eigen::Vector3d>& points_in_board);

}  // namespace alidade
