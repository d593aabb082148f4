#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/calibrate/calibrate.h"

namespace alidade {

/// What one view says of all parameters of the lens, also of those that are fixed: its pose eliminated, the board as
/// it was solved.
struct ViewScore {
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;
  double depth_m = 0.0;  ///< Of the board's middle, along the optical axis.
};

/// One for each view in use, in their order. Empty where the linearisation fails.
[[nodiscard]] std::vector<ViewScore> view_scores(const Board& board, CalibrateConfig config,
                                                 std::span<const BoardView> views, const CalibrateReport& report);

/// Positions of the lens parameters that were estimated, and of those that were fixed.
struct LensSplit {
  std::vector<Eigen::Index> free, fixed;
};
[[nodiscard]] LensSplit split_of(const CalibrateReport& report);

}  // namespace alidade
