#include "alidade/calibrate/checks/corner_numbering.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "alidade/testing/calibration_sample.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using testing::sample_board;
using testing::sample_calibration;

/// Views as a table without σ gives them.
std::vector<BoardView> plain_views(unsigned seed) {
  const auto scene = testing::covered_scene(testing::sample_camera("brown"), 20, seed);
  return testing::sample_views(scene, seed, /*know_sigma=*/false);
}

void renumber(BoardView& view, const std::function<int(int col, int row)>& number) {
  const int cols = sample_board.cols;
  for (Corner& corner : view.corners) corner.index = number(corner.index % cols, corner.index / cols);
}

TEST(CornerNumbering, AFewViewsNumberedOtherwiseAreNamedAndTheRestIsRight) {
  const int cols = sample_board.cols, rows = sample_board.rows;
  const Calibration clean = sample_calibration(plain_views(5));
  const std::vector<std::pair<std::string, std::function<int(int, int)>>> ways{
      {"column by column", [&](int col, int row) { return col * rows + row; }},
      {"from left and from right in turn",
       [&](int col, int row) { return row * cols + (row % 2 == 0 ? col : cols - 1 - col); }},
      {"seen from behind", [&](int col, int row) { return row * cols + cols - 1 - col; }}};
  for (const auto& [words, number] : ways) {
    SCOPED_TRACE(words);
    std::vector<BoardView> views = plain_views(5);
    for (const std::size_t k : {2u, 9u, 14u}) renumber(views[k], number);
    const Calibration calibration = sample_calibration(views);
    for (std::size_t k = 0; k < views.size(); ++k) {
      EXPECT_EQ(calibration.views[k].used, k != 2 && k != 9 && k != 14) << calibration.views[k].reason;
      if (!calibration.views[k].used) EXPECT_THAT(calibration.views[k].reason, HasSubstr(words));
    }
    const Eigen::VectorXd here = params(calibration.camera.lens), there = params(clean.camera.lens);
    for (int i = 0; i < 4; ++i)
      EXPECT_NEAR(here[i], there[i], 3.0 * std::sqrt(calibration.camera.cov(i, i))) << "of the same camera";
  }
}

/// 8×5 corners counted one after the other stand for a board of 9×6.
TEST(CornerNumbering, AnotherBoardIsNamedByItsWidth) {
  std::vector<BoardView> views = plain_views(6);
  BoardView other{views[3].photo, {}};
  for (const Corner& corner : views[3].corners) {
    const int col = corner.index % sample_board.cols, row = corner.index / sample_board.cols;
    if (col < sample_board.cols - 1 && row < sample_board.rows - 1) other.corners.push_back(corner);
    if (col < sample_board.cols - 1 && row < sample_board.rows - 1)
      other.corners.back().index = row * (sample_board.cols - 1) + col;
  }
  views[3] = other;
  const auto faults = numbering_faults(sample_board, views, points_in_board(sample_board));
  EXPECT_THAT(faults[3], HasSubstr(std::to_string(sample_board.cols - 1) + " in a row"));
}

TEST(CornerNumbering, ATableThatIsAllNumberedByColumnsIsRefusedByName) {
  std::vector<BoardView> views = plain_views(7);
  for (BoardView& view : views) renumber(view, [&](int col, int row) { return col * sample_board.rows + row; });
  const Calibration calibration = sample_calibration(views);
  EXPECT_EQ(calibration.verdict.exit_code, ExitCode::undetermined);
  EXPECT_THAT(calibration.verdict.sentence, HasSubstr("column by column"));
  EXPECT_THAT(calibration.verdict.to_add, HasSubstr("row by row"));
}

/// Distortion bends a board's picture; half of its corners may be hidden; one may be anywhere.
TEST(CornerNumbering, RightViewsOfStrongLensesHaveNoFault) {
  for (const std::string lens : {"brown", "kannala_brandt"}) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
      auto views = testing::sample_views(testing::covered_scene(testing::sample_camera(lens), 20, seed), seed);
      views[1].corners.resize(views[1].corners.size() / 2);
      views[2].corners[5].px += Eigen::Vector2d(400.0, -300.0);
      for (const std::string& fault : numbering_faults(sample_board, views, points_in_board(sample_board)))
        EXPECT_EQ(fault, "") << lens;
    }
  }
}

}  // namespace
}  // namespace alidade
