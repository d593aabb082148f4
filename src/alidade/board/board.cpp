#include "alidade/board/board.h"

namespace alidade {
namespace {

/// Corners of tag (col, row): top-left, top-right, bottom-right, bottom-left, as ArUco orders them.
void append_tag(const Board& board, int col, int row, std::vector<Eigen::Vector3d>& points) {
  const double pitch_m = board.square_m + board.marker_m;
  const double x = col * pitch_m, y = row * pitch_m, side = board.square_m;
  points.emplace_back(x, y, 0.0);
  points.emplace_back(x + side, y, 0.0);
  points.emplace_back(x + side, y + side, 0.0);
  points.emplace_back(x, y + side, 0.0);
}

}  // namespace

double circle_radius_m(const Board& board) {
  return board.marker_m > 0.0 ? 0.5 * board.marker_m : 0.2 * board.square_m;
}

int num_points(const Board& board) { return board.cols * board.rows * (board.kind == BoardKind::aprilgrid ? 4 : 1); }

std::vector<Eigen::Vector3d> points_in_board(const Board& board) {
  std::vector<Eigen::Vector3d> points;
  points.reserve(static_cast<std::size_t>(num_points(board)));
  for (int row = 0; row < board.rows; ++row) {
    for (int col = 0; col < board.cols; ++col) {
      if (board.kind == BoardKind::aprilgrid) {
        append_tag(board, col, row, points);
      } else if (board.kind == BoardKind::asymmetric_circles) {  // every other row is shifted by one pitch
        points.emplace_back((2 * col + row % 2) * board.square_m, row * board.square_m, 0.0);
      } else {
        points.emplace_back(col * board.square_m, row * board.square_m, 0.0);
      }
    }
  }
  return points;
}

}  // namespace alidade
