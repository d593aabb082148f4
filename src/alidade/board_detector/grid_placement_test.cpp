#include "alidade/board_detector/grid_placement.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <set>

namespace alidade {
namespace {

/// A board as seen, rotated by an angle, with the dark square outside the corner that numbering should call (0, 0); the
/// grid counts from anywhere, in steps of its own.
CornerGrid seen_board(int cols, int rows, double angle_rad, int quarter_turns_of_grid = 0) {
  const Eigen::Rotation2Dd turn(angle_rad);
  const Eigen::Vector2d x = turn * Eigen::Vector2d(20.0, 0.0), y = turn * Eigen::Vector2d(0.0, 20.0);
  CornerGrid grid;
  for (int row = 0; row < rows; ++row) {
    for (int col = 0; col < cols; ++col) {
      const GridCorner corner{Eigen::Vector2d(300, 200) + col * x + row * y, x, y};
      // Bright where i + j is even between +i and +j: corner (0, 0), dark there, is counted from an odd position.
      switch (quarter_turns_of_grid) {
        case 1:
          grid.corners[{row, -col}] = {corner.px, y, -x};
          break;
        case 2:
          grid.corners[{-col, -row - 1}] = {corner.px, -x, -y};
          break;
        case 3:
          grid.corners[{-row, col}] = {corner.px, -y, x};
          break;
        default:
          grid.corners[{col, row + 1}] = corner;
      }
    }
  }
  return grid;
}

Eigen::Vector2d place(const PlacedGrid& placed, int col, int row) { return placed.grid.at(col, row)->px; }

TEST(PlaceGrid, NumbersABoardAlikeHoweverItIsTurned) {
  for (int i = 0; i < 12; ++i) {
    for (int quarter_turns = 0; quarter_turns < 4; ++quarter_turns) {
      const CornerGrid seen = seen_board(9, 6, 0.5236 * i + 0.1, quarter_turns);
      const PlacedGrid placed = place_grid(seen, 9, 6);
      ASSERT_EQ(placed.reason, "") << i << " " << quarter_turns;
      ASSERT_EQ(placed.grid.corners.size(), 54u);
      EXPECT_NEAR((place(placed, 0, 0) - Eigen::Vector2d(300, 200)).norm(), 0.0, 1e-9);
      const Eigen::Vector2d x = place(placed, 1, 0) - place(placed, 0, 0),
                            y = place(placed, 0, 1) - place(placed, 0, 0);
      EXPECT_GT(x.x() * y.y() - x.y() * y.x(), 0.0);  // never mirrored
      EXPECT_NEAR((placed.grid.at(3, 2)->step_i - x).norm(), 0.0, 1e-9);
    }
  }
}

TEST(PlaceGrid, PrefersUprightWhereTurnedBoardsLookTheSame) {
  for (const auto& [cols, rows] : {std::pair{8, 6}, std::pair{10, 10}, std::pair{7, 7}}) {
    const PlacedGrid placed = place_grid(seen_board(cols, rows, 3.1), cols, rows);  // upside down
    ASSERT_EQ(placed.reason, "");
    const Eigen::Vector2d x = place(placed, 1, 0) - place(placed, 0, 0);
    EXPECT_GT(x.x(), 19.0);
  }
}

TEST(PlaceGrid, NamesTheSizeThatWasSeen) {
  EXPECT_EQ(place_grid(seen_board(9, 6, 0.1), 8, 6).reason, "a grid of 9×6 corners, not 8×6");
  EXPECT_EQ(place_grid(seen_board(9, 6, 0.1), 6, 8).reason, "a grid of 6×9 corners, not 6×8");
}

TEST(PlaceGrid, ForgetsAStrayLineOfFewCorners) {
  CornerGrid seen = seen_board(9, 6, 0.1);
  for (const int row : {2, 3}) seen.corners[{9, row}] = *seen.at(8, row);
  EXPECT_EQ(place_grid(seen, 9, 6).grid.corners.size(), 54u);
}

TEST(PlaceGrid, PlacesAPartOnlyWhereOnePlaceIsLeft) {
  const CornerGrid part = seen_board(9, 5, 0.0);  // the last row is missing
  EXPECT_EQ(place_grid(part, 9, 6).reason, "only 9×5 of 9×6 corners, and it cannot be determined which");
  const PlacedGrid placed = place_grid(part, 9, 6, {false, false, true, false});  // the board's upper border is seen
  ASSERT_EQ(placed.reason, "");
  EXPECT_NEAR((place(placed, 0, 0) - Eigen::Vector2d(300, 200)).norm(), 0.0, 1e-9);
  EXPECT_EQ(placed.grid.at(0, 5), nullptr);
}

TEST(PlaceGrid, SaysThatABoardWithAllItsBordersIsSmaller) {
  EXPECT_EQ(place_grid(seen_board(8, 6, 0.0), 9, 6, {true, true, true, true}).reason, "a grid of 8×6 corners, not 9×6");
}

}  // namespace
}  // namespace alidade
