#pragma once

#include "alidade/board_detector/corner_grid.h"
#include "alidade/board_detector/grid_placement.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Adds outer lines of corners that the search missed: those with at least half of their predicted corners fitted,
/// with the colours that the grid predicts. No side grows beyond `max_lines` lines. `photo`: one channel, float, 0 to
/// 255.
void extend_by_fit(const cv::Mat& photo, CornerGrid& grid, int max_lines);

/// Which sides of the grid are the border of the board: the outer squares are visible beyond the last corners, and
/// nothing alternates beyond them. A side that leaves the image or is covered is not known to be a border.
[[nodiscard]] GridBorders find_borders(const cv::Mat& photo, const CornerGrid& grid);

}  // namespace alidade
