#pragma once

#include "alidade/board/board.h"
#include "alidade/board_detector/find_board.h"

namespace alidade {

/// Detects a charuco board or an aprilgrid, whole or in part: its markers give the approximate positions of its points,
/// fit_corner() the accurate ones with their covariance. A point is accepted only if its two edges look as expected.
/// `photo` is one channel of 32-bit float, 0 to 255. Aprilgrids need the black squares between tags of Kalibr's target.
[[nodiscard]] BoardDetection find_marker_board(const cv::Mat& photo, const Board& board);

/// Fits the points of the board again with known lens and pose, including those that the first search missed.
[[nodiscard]] BoardDetection refind_marker_board(const cv::Mat& photo, const Board& board, const BoardView& first,
                                                 const Camera& camera, const Rigid3& cam_from_board);

/// Number of different markers of a dictionary in a photo, wherever they are.
[[nodiscard]] std::size_t count_markers(const cv::Mat& photo, const std::string& dictionary);

}  // namespace alidade
