#include "alidade/board/board.h"

#include <gtest/gtest.h>

namespace alidade {
namespace {

TEST(Board, HasAsManyPointsAsItSaysWhateverItsKind) {
  int num_checked = 0;
  for (const BoardKind kind : {BoardKind::chessboard, BoardKind::charuco, BoardKind::aprilgrid, BoardKind::circles,
                               BoardKind::asymmetric_circles}) {
    for (const auto& [cols, rows] : {std::pair{9, 6}, std::pair{2, 2}, std::pair{4, 11}}) {
      const Board board{kind, cols, rows, 0.03, 0.01, "DICT_5X5_100"};
      EXPECT_EQ(points_in_board(board).size(), static_cast<std::size_t>(num_points(board)));
      ++num_checked;
    }
  }
  EXPECT_EQ(num_checked, 15);
}

TEST(Board, OfANegativeNumberOfColumnsHasNoPoints) {
  EXPECT_TRUE(points_in_board({.cols = -1, .rows = 6, .square_m = 0.02}).empty());
}

TEST(Board, ChessboardPointsAreNumberedRowByRow) {
  const Board board{BoardKind::chessboard, 3, 2, 0.5, 0.0, ""};
  const std::vector<Eigen::Vector3d> expected{{0, 0, 0},   {0.5, 0, 0},   {1, 0, 0},
                                              {0, 0.5, 0}, {0.5, 0.5, 0}, {1, 0.5, 0}};
  EXPECT_EQ(points_in_board(board), expected);
}

TEST(Board, AprilgridTagsHaveFourCornersClockwiseAndAGap) {
  const std::vector<Eigen::Vector3d> points = points_in_board({BoardKind::aprilgrid, 2, 1, 4.0, 1.0, ""});
  const std::vector<Eigen::Vector3d> expected{{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0},
                                              {5, 0, 0}, {9, 0, 0}, {9, 4, 0}, {5, 4, 0}};
  EXPECT_EQ(points, expected);
}

TEST(Board, EveryOtherRowOfAsymmetricCirclesIsShiftedByHalfAPitch) {
  // The layout of OpenCV's tutorial: x = (2 col + row mod 2) s, y = row s.
  const std::vector<Eigen::Vector3d> points = points_in_board({BoardKind::asymmetric_circles, 4, 11, 0.02, 0.0, ""});
  EXPECT_EQ(points[3], Eigen::Vector3d(6 * 0.02, 0, 0));
  EXPECT_EQ(points[4], Eigen::Vector3d(0.02, 0.02, 0));
  EXPECT_EQ(points[43], Eigen::Vector3d(6 * 0.02, 10 * 0.02, 0));
}

}  // namespace
}  // namespace alidade
