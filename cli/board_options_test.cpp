#include "cli/board_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>

#include "cli/run.h"

namespace alidade::cli {
namespace {

Board parse(const std::string& line) {
  CLI::App app;
  BoardOptions options;
  add_board_options(app, options);
  app.parse(line);
  return board_from(options);
}

std::string fault_of(const std::string& line) {
  try {
    (void)parse(line);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(BoardOptions, DescribeEveryKind) {
  EXPECT_EQ(parse("--board 9x6 --square 0.025"), (Board{BoardKind::chessboard, 9, 6, 0.025, 0.0, ""}));
  EXPECT_EQ(parse("--board 8X5 --square 0.03 --target charuco --marker 0.022 --dictionary DICT_4X4_50"),
            (Board{BoardKind::charuco, 8, 5, 0.03, 0.022, "DICT_4X4_50"}));
  EXPECT_EQ(parse("--board 6x6 --square 0.088 --target aprilgrid --marker 0.0264"),
            (Board{BoardKind::aprilgrid, 6, 6, 0.088, 0.0264, ""}));
  EXPECT_EQ(parse("--board 4x11 --square 0.02 --target asymmetric_circles"),
            (Board{BoardKind::asymmetric_circles, 4, 11, 0.02, 0.0, ""}));
}

TEST(BoardOptions, NameWhatIsWrong) {
  for (const std::string size : {"9", "9x", "x6", "9x6x2", "9.5x6", "-9x6", "0x6", "9 6", "99999999999x6"}) {
    EXPECT_EQ(fault_of("--square 0.025 --board=\"" + size + "\""),
              "--board: '" + size + "' is not COLSxROWS, for example 9x6");
  }
  EXPECT_EQ(fault_of("--board 1x6 --square 0.025"), "--board: a board has 2 to 200 columns and rows, not 1x6");
  EXPECT_EQ(fault_of("--board 9x6 --square 0.025 --target charuco"), "--target charuco needs --marker M");
  EXPECT_EQ(fault_of("--board 9x6 --square 0.025 --marker 0.01"), "--marker: a chessboard has none");
  for (const std::string value : {"0", "-1", "nan", "inf", "one"}) {
    EXPECT_THAT(fault_of("--board 9x6 --square " + value), ::testing::StartsWith("--square: '" + value + "' is not"));
  }
}

TEST(BoardOptions, SayWhereMillimetresWereMeant) {
  Board board;
  board.square_m = 25.0;
  EXPECT_EQ(odd_size(board), "note: squares of 25 m; lengths are in metres, and 25 mm is --square 0.025");
  for (const double usual_m : {0.004, 0.025, 1.0}) {  // 1: many do not care for the unit
    board.square_m = usual_m;
    EXPECT_EQ(odd_size(board), "");
  }
}

}  // namespace
}  // namespace alidade::cli
