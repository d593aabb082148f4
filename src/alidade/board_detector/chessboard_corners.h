#pragma once

#include "alidade/board/board.h"
#include "alidade/board_detector/find_board.h"
#include "alidade/board_detector/kinds/chessboard.h"

namespace alidade {

/// Fits every corner of a coarsely detected chessboard with subpixel accuracy, and searches for those that the coarse
/// search missed at their predicted positions. `photo` is one channel of 32-bit float, 0 to 255.
[[nodiscard]] BoardDetection fit_chessboard(const cv::Mat& photo, const Board& board, const Chessboard& coarse);

/// Fits the corners of `first` again, each from its position predicted by lens and pose, with the edges curved as by
/// the lens. Corners that the first fit rejected are tried too.
[[nodiscard]] BoardDetection refit_chessboard(const cv::Mat& photo, const Board& board, const BoardView& first,
                                              const Camera& camera, const Rigid3& cam_from_board);

}  // namespace alidade
