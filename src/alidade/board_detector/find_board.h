#pragma once

#include <string>

#include "alidade/board/board.h"
#include "alidade/board/board_view.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace cv {
class Mat;
}

namespace alidade {

/// A board in a photo, or the reason why there is none.
struct BoardDetection {
  BoardView view;      ///< Corners with covariance; empty if the board was not found.
  std::string reason;  ///< "no chessboard grid: only 3×2 of 9×6 corners", …; empty if it was found.
  [[nodiscard]] bool found() const { return reason.empty(); }
};
/// No board, for this reason, which must not be empty.
[[nodiscard]] BoardDetection not_found(std::string reason);

/// Detects a board of any kind in a photo (8- or 16-bit, grey or colour) and fits its points with subpixel accuracy,
/// each with its covariance. The point (0, 0) is chosen so that repeated photos are numbered alike if the pattern
/// permits. `reject_partial`: a chessboard that is not completely visible counts as not found.
[[nodiscard]] BoardDetection find_board(const cv::Mat& photo, const Board& board, bool reject_partial = false);

/// Fits the same corners again with known lens and pose: edges are curved by the lens, initial guesses
/// are the predicted corners, points outside the image are rejected. Bouguet's second extraction.
[[nodiscard]] BoardDetection refind_board(const cv::Mat& photo, const Board& board, const BoardView& first,
                                          const Camera& camera, const Rigid3& cam_from_board);

}  // namespace alidade
