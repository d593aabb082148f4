#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/calibrate/calibrate.h"

namespace alidade {

/// Score and information of one view for all parameters of the lens, including fixed ones: pose eliminated, board as
/// estimated.
struct ViewScore {
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;
  double depth_m = 0.0;  ///< Depth of the board's centre along the optical axis.
};

/// One per used view, in order. Empty if the linearisation fails.
[[nodiscard]] std::vector<ViewScore> view_scores(const Board& board, CalibrateConfig config,
                                                 std::span<const BoardView> views, const CalibrateReport& report);

/// Indices of the lens parameters that were estimated, and of those that were fixed.
struct LensSplit {
  std::vector<Eigen::Index> free, fixed;
};
[[nodiscard]] LensSplit split_of(const CalibrateReport& report);

}  // namespace alidade
