#pragma once

#include <vector>

#include "alidade/spot/laser_spot.h"
#include "alidade/spot/spot_signal.h"

namespace alidade {

/// Outline of the printed area of a board in the photo [px]: its corners with points in between, because distortion
/// curves its sides. Empty if the camera does not see all of them.
[[nodiscard]] std::vector<Eigen::Vector2d> printed_outline(const SeenBoard& seen);

/// Fraction of paper in each pixel of part of the photo, 0 ink to 1 paper, for a chessboard's squares with sharp edges.
[[nodiscard]] Image paper_share(const SeenBoard& seen, int u_min, int v_min, int cols, int rows);

}  // namespace alidade
