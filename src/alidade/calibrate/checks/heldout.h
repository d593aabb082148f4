#pragma once

#include <span>
#include <vector>

#include "alidade/calibrate/study.h"

namespace alidade {

/// Error on held-out photos (five folds; the camera is fixed, their poses are estimated again), for the model in use
/// and for its simpler and richer neighbours. `views` are the used ones.
[[nodiscard]] std::vector<HeldOutModel> heldout_models(const Board& board, std::span<const BoardView> views,
                                                       ImageSize size, const CalibrateConfig& config,
                                                       const std::vector<Eigen::Vector3d>& board_points,
                                                       const Progress& progress);

}  // namespace alidade
