#pragma once

#include <string>

#include "alidade/board_detector/corner_grid.h"

namespace cv {
class Mat;
}

namespace alidade {

/// The inner corners of a chessboard in a photo, to a fraction of a pixel, key (column, row); or why there are none.
struct Chessboard {
  CornerGrid grid;
  double pixel_scale = 1.0;  ///< Size in the photo of a pixel in which it was found: its corners' precision.
  std::string reason;
};

/// Finds a chessboard of cols × rows inner corners, whole or in part. `photo` is one channel of 32-bit float, 0 to 255.
/// Looks at the photo in its own size and at half, quarter and double of it, and stops at the first whole board.
[[nodiscard]] Chessboard find_chessboard(const cv::Mat& photo, int cols, int rows);

/// The same at one size only, the photo divided by `scale`: for video, many images per second.
[[nodiscard]] Chessboard find_chessboard_at(const cv::Mat& photo, int cols, int rows, double scale);

}  // namespace alidade
