#pragma once

#include "alidade/board/board.h"
#include "alidade/board_detector/find_board.h"

namespace alidade {

/// Finds a charuco board or an aprilgrid, whole or in part: its markers say where its points are about, fit_corner()
/// where exactly and how well. A point is taken only if its two edges look as they must there. `photo` is one channel
/// of 32-bit float, 0 to 255. Aprilgrids need the black squares between the tags that Kalibr's target has.
[[nodiscard]] BoardDetection find_marker_board(const cv::Mat& photo, const Board& board);

/// Fits the points of the board again where lens and pose are known, those that the first search missed as well.
[[nodiscard]] BoardDetection refind_marker_board(const cv::Mat& photo, const Board& board, const BoardView& first,
                                                 const Camera& camera, const Rigid3& cam_from_board);

/// How many different markers of a dictionary a photo shows, wherever they stand.
[[nodiscard]] std::size_t count_markers(const cv::Mat& photo, const std::string& dictionary);

}  // namespace alidade
