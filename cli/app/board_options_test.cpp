#include "cli/app/board_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>

#include "cli/app/run.h"

namespace alidade::cli {
namespace {

Board parse(const std::string& line) {
  CLI::App app;
  Board board = no_board();
  add_board_options(app, board);
  app.parse(line);
  require_board(board);
  return board;
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
  EXPECT_EQ(parse("--board 9×6 --square 0.025"), (Board{BoardKind::chessboard, 9, 6, 0.025, 0.0, ""}));
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
  EXPECT_EQ(fault_of("--board 9x6 --square 0.025 --target charuco"), "--board-kind charuco needs --marker M");
  EXPECT_EQ(fault_of("--board 9x6 --square 0.025 --marker 0.01"), "--marker: a chessboard has none");
  for (const std::string value : {"0", "-1", "nan", "inf", "one"}) {
    EXPECT_THAT(fault_of("--board 9x6 --square " + value), ::testing::StartsWith("--square: '" + value + "' is not"));
  }
}

TEST(BoardOptions, AskWhereMillimetresWereMeant) {
  EXPECT_EQ(fault_of("--board 9x6 --square 25"),
            "--square: '25' would be 25 m: give metres, 0.025, or a unit, 25mm or 25m");
  EXPECT_THAT(fault_of("--board 9x6 --square 2.5"), ::testing::HasSubstr("2.5mm or 2.5m"));
  EXPECT_THAT(fault_of("--board 9x6 --square 0.03 --target charuco --marker 22"),
              ::testing::HasSubstr("0.022, or a unit"));
  EXPECT_EQ(fault_of("--board 9x6 --square 0.00025"),
            "--square: '0.00025' is in metres, 0.25 mm: if that is meant, with its unit, 0.25mm");
  for (const double usual_m : {0.0005, 0.004, 0.025, 1.0, 2.0}) {  // 1: many do not care for the unit
    EXPECT_EQ(parse("--board 9x6 --square " + std::to_string(usual_m)).square_m, usual_m);
  }
}

TEST(BoardOptions, LengthsMayHaveTheirUnit) {
  EXPECT_DOUBLE_EQ(parse("--board 9x6 --square 25mm").square_m, 0.025);
  EXPECT_DOUBLE_EQ(parse("--board 9x6 --square 2.5cm").square_m, 0.025);
  EXPECT_DOUBLE_EQ(parse("--board 9x6 --square 3m").square_m, 3.0) << "painted on a runway";
  EXPECT_DOUBLE_EQ(parse("--board 9x6 --square 0.1mm").square_m, 1e-4) << "etched on glass";
  for (const std::string length : {"25 mm", "25um", "-25mm", "0mm", "mm", "infmm", "25mmm"}) {
    EXPECT_NE(fault_of("--board 9x6 --square \"" + length + "\""), "") << length;
  }
}

}  // namespace
}  // namespace alidade::cli
