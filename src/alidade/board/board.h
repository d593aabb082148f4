#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

enum class BoardKind { chessboard, charuco, aprilgrid, circles, asymmetric_circles };

/// The word for a kind in options and files, and the kind for a word. None for an unknown word.
[[nodiscard]] std::string_view kind_name(BoardKind kind);
[[nodiscard]] std::optional<BoardKind> board_kind(std::string_view name);

/// A calibration target. Its points lie in frame `board`: x along the columns, y along the rows, z = x × y (away from
/// a camera that sees the board upright), the origin at point 0; points are numbered row by row, left to right.
/// Chessboard, charuco: the square at the top left is black; markers are numbered row by row (OpenCV 4.6's layout).
/// Aprilgrid: Kalibr's target, tags 36h11 with black squares in the gaps, tag 0 at the bottom LEFT; the points are
/// still numbered from the top left, four per tag: top-left, top-right, bottom-right, bottom-left.
/// Asymmetric circles: rows 1, 3, … are shifted by one pitch; circles in the same row are two pitches apart.
struct Board {
  BoardKind kind = BoardKind::chessboard;
  int cols = 9;  ///< Inner corners (chessboard, charuco), circles, or tags (aprilgrid) along x.
  int rows = 6;
  double square_m = 0.025;      ///< Pitch: square side, circle spacing, or tag side (aprilgrid). [m]
  double marker_m = 0.0;        ///< Marker side (charuco), gap between tags (aprilgrid), diameter (circles). [m]
  std::string dictionary = "";  ///< ArUco dictionary (charuco), for example DICT_5X5_100.

  bool operator==(const Board&) const = default;
};

/// Radius of the circles of a circle grid [m]: half of `marker_m`, or, if that is 0, 1/5 of the pitch as drawn by
/// OpenCV's pattern generator.
[[nodiscard]] double circle_radius_m(const Board& board);

/// Number of points of a board: 4 per tag for an aprilgrid, one per corner or circle otherwise.
[[nodiscard]] int num_points(const Board& board);

/// The board's points [m], indexed by their number. A printed board deviates slightly from them; see `BoardShape`.
[[nodiscard]] std::vector<Eigen::Vector3d> points_in_board(const Board& board);

ALIDADE_PUBLIC_END
}  // namespace alidade
