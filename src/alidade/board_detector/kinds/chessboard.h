#pragma once

#include <string>

#include "alidade/board_detector/corner_grid.h"

namespace cv {
class Mat;
}

namespace alidade {

/// The inner corners of a chessboard in a photo, with subpixel accuracy, key (column, row); or why there are none.
struct Chessboard {
  CornerGrid grid;
  double pixel_scale = 1.0;  ///< Size of the search image's pixels in the photo: the corners' precision.
  std::string reason;
};

/// Detects a chessboard of cols × rows inner corners, whole or in part. `photo` is one channel of 32-bit float, 0 to
/// 255. Searches the photo at its own size and at half, quarter and double that, and stops at the first whole board.
[[nodiscard]] Chessboard find_chessboard(const cv::Mat& photo, int cols, int rows);

/// The same at one size only, the photo reduced by `scale`: for video with many images per second.
[[nodiscard]] Chessboard find_chessboard_at(const cv::Mat& photo, int cols, int rows, double scale);

}  // namespace alidade
