#pragma once

#include "alidade/board/board.h"
#include "alidade/calibrate/calibration.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Fills counts, estimate, stddev, covariance, data tables and grids of `document` from a calibration: the names of
/// docs' contract for `calibrate`. For a refusal, what there is.
void fill_calibration(const Board& board, const Calibration& calibration, ResultDocument& document);

/// Table `next`: poses and what they bring.
[[nodiscard]] DataTable next_photos_table(const NextPhotoPlan& plan);

/// Table `points_in_board`: x_m, y_m, z_m of the points of a board in its own frame, to draw it by.
[[nodiscard]] DataTable points_in_board_table(const std::vector<Eigen::Vector3d>& points_in_board);

}  // namespace alidade
