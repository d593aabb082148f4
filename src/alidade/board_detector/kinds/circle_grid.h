#pragma once

#include "alidade/board/board.h"
#include "alidade/board_detector/find_board.h"

namespace alidade {

/// Detects a symmetric or asymmetric grid of circles and fits a blurred ellipse to each. The image of a circle's centre
/// is not the centre of its ellipse: the difference is corrected using the perspective of the grid around the circle.
/// Dark circles on white paper. `photo` is one channel of 32-bit float, 0 to 255.
[[nodiscard]] BoardDetection find_circle_grid(const cv::Mat& photo, const Board& board);

/// Fits the same circles again with known lens and pose: the correction then includes the lens.
/// J. Heikkilä, "Geometric camera calibration using circular control points", PAMI 22(10), 2000.
[[nodiscard]] BoardDetection refind_circle_grid(const cv::Mat& photo, const Board& board, const BoardView& first,
                                                const Camera& camera, const Rigid3& cam_from_board);

}  // namespace alidade
