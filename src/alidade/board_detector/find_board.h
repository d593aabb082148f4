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
  BoardView view;      ///< Corners with covariance; empty where the board was not found.
  std::string reason;  ///< "no chessboard grid: only 3×2 of 9×6 corners", …; empty where it was found.
  [[nodiscard]] bool found() const { return reason.empty(); }
};
/// No board, for this reason; the reason must not be empty.
[[nodiscard]] BoardDetection not_found(std::string reason);

/// Finds a board of any kind in a photo (8- or 16-bit, grey or colour) and fits its points below the pixel, each with
/// its covariance. The point (0, 0) is chosen so that repeated photos number alike where the pattern allows it.
/// `reject_partial`: a chessboard of which not all corners are seen is not found.
[[nodiscard]] BoardDetection find_board(const cv::Mat& photo, const Board& board, bool reject_partial = false);

/// Fits the same corners again where the lens and the pose are known: edges are curved by the lens, starting points
/// are the predicted ones, points outside the image are rejected. Bouguet's second extraction.
[[nodiscard]] BoardDetection refind_board(const cv::Mat& photo, const Board& board, const BoardView& first,
                                          const Camera& camera, const Rigid3& cam_from_board);

}  // namespace alidade
