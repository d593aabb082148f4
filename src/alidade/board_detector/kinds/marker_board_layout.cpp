#include "alidade/board_detector/kinds/marker_board_layout.h"

#include <algorithm>

namespace alidade {
namespace {

std::array<Eigen::Vector2d, 4> square_at(double x, double y, double side) {
  return {Eigen::Vector2d(x, y), {x + side, y}, {x + side, y + side}, {x, y + side}};
}

MarkerLayout charuco_layout(const Board& board, bool starts_black) {
  MarkerLayout layout;
  layout.dictionary = board.dictionary;
  const double border = 0.5 * (board.square_m - board.marker_m);
  for (int row = 0; row <= board.rows; ++row) {
    for (int col = 0; col <= board.cols; ++col) {
      const bool is_black = ((row + col) % 2 == 0) == starts_black;
      if (is_black) continue;
      layout.markers.push_back(
          square_at((col - 1) * board.square_m + border, (row - 1) * board.square_m + border, board.marker_m));
    }
  }
  for (int row = 0; row < board.rows; ++row)
    for (int col = 0; col < board.cols; ++col) layout.bright.push_back(((row + col) % 2 == 1) == starts_black);
  layout.clear_m = border;
  layout.pitch_m = board.square_m;
  return layout;
}

MarkerLayout aprilgrid_layout(const Board& board, int border_bits, bool from_bottom) {
  MarkerLayout layout;
  layout.dictionary = "DICT_APRILTAG_36h11";
  layout.border_bits = border_bits;
  layout.pitch_m = board.square_m + board.marker_m;
  layout.clear_m = std::min(board.marker_m, board.square_m * border_bits / (6 + 2 * border_bits));
  for (int i = 0; i < board.rows; ++i) {
    const int row = from_bottom ? board.rows - 1 - i : i;
    for (int col = 0; col < board.cols; ++col)
      layout.markers.push_back(square_at(col * layout.pitch_m, row * layout.pitch_m, board.square_m));
  }
  for (int i = 0; i < num_points(board); ++i) layout.bright.push_back(i % 2 == 1);
  return layout;
}

}  // namespace

std::vector<MarkerLayout> marker_layouts(const Board& board) {
  if (board.kind == BoardKind::charuco) {
    std::vector<MarkerLayout> layouts{charuco_layout(board, true)};
    if ((board.rows + 1) % 2 == 0) layouts.push_back(charuco_layout(board, false));
    return layouts;
  }
  return {aprilgrid_layout(board, 2, true), aprilgrid_layout(board, 2, false), aprilgrid_layout(board, 1, true),
          aprilgrid_layout(board, 1, false)};
}

}  // namespace alidade
