#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/board/board_view.h"

namespace cv {
class Mat;
}

namespace alidade {

/// A board from a quick search, in a fraction of the time of find_board().
struct QuickLook {
  BoardView view;        ///< Corners to about a tenth of a pixel; empty if the board was not found.
  double blur_px = 0.0;  ///< Median σ of the blur at a few corners; 0: unknown (boards without crossing edges).
  std::string reason;    ///< Why there is none; empty if there is one.
  std::pair<int, int> other_grid = {0, 0};  ///< Columns and rows of a detected chessboard of another size; zeros: none.
  [[nodiscard]] bool found() const { return reason.empty(); }
};

/// Searches for a board in consecutive images of a video: first around its last position, then everywhere; above two
/// megapixels in a reduced image. Keeps the last position of the board.
class QuickLooker {
 public:
  explicit QuickLooker(const Board& board) : board_(board) {}
  [[nodiscard]] QuickLook look(const cv::Mat& photo);

 private:
  [[nodiscard]] QuickLook look_in(const cv::Mat& photo, int left_px, int top_px, int width_px, int height_px);
  [[nodiscard]] QuickLook look_for_points(const cv::Mat& photo);

  struct Area {
    double left_px, top_px, right_px, bottom_px;
  };
  Board board_;
  std::optional<Area> last_;
};

}  // namespace alidade
