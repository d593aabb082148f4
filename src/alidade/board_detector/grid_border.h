#pragma once

#include "alidade/board_detector/corner_grid.h"
#include "alidade/board_detector/grid_placement.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Adds outer lines of corners that the search missed: those at whose predicted positions half or more can be fitted,
/// with the colours that the grid foretells. No side grows beyond `max_lines` lines. `photo`: one channel, float, 0 to
/// 255.
void extend_by_fit(const cv::Mat& photo, CornerGrid& grid, int max_lines);

/// Which sides of the grid are the board's border: the outer squares are seen beyond the last corners, and nothing
/// alternates beyond them. A side that leaves the image or is covered is not known to be one.
[[nodiscard]] GridBorders find_borders(const cv::Mat& photo, const CornerGrid& grid);

}  // namespace alidade
