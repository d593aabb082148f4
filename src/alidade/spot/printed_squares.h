#pragma once

#include <vector>

#include "alidade/spot/laser_spot.h"
#include "alidade/spot/spot_signal.h"

namespace alidade {

/// Corners of the printed area of a board in the photo [px], with points between, as the lens curves its sides. Empty
/// where the camera does not see them all.
[[nodiscard]] std::vector<Eigen::Vector2d> printed_outline(const SeenBoard& seen);

/// Share of paper in each pixel of a part of the photo, 0 ink to 1 paper, of a chessboard's squares with sharp edges.
[[nodiscard]] Image paper_share(const SeenBoard& seen, int u_min, int v_min, int cols, int rows);

}  // namespace alidade
