#include "alidade/board/board.h"

#include <array>
#include <utility>

namespace alidade {
namespace {

constexpr std::array<std::pair<std::string_view, BoardKind>, 5> kinds{
    {{"chessboard", BoardKind::chessboard},
     {"charuco", BoardKind::charuco},
     {"aprilgrid", BoardKind::aprilgrid},
     {"circles", BoardKind::circles},
     {"asymmetric_circles", BoardKind::asymmetric_circles}}};

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

std::string_view kind_name(BoardKind kind) {
  for (const auto& [name, known] : kinds) {
    if (known == kind) return name;
  }
  return "";
}

std::optional<BoardKind> board_kind(std::string_view name) {
  for (const auto& [known, kind] : kinds) {
    if (known == name) return kind;
  }
  return std::nullopt;
}

int num_points(const Board& board) { return board.cols * board.rows * (board.kind == BoardKind::aprilgrid ? 4 : 1); }

std::vector<Eigen::Vector3d> points_in_board(const Board& board) {
  std::vector<Eigen::Vector3d> points;
  if (board.cols < 1 || board.rows < 1) return points;
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
