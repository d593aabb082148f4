#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/calibrate.h"
#include "alidade/testing/calibration_sample.h"

// The whole job through its public header: the same camera as from the parts, and an answer to every misuse.

namespace alidade {
namespace {

using testing::sample_board;
using testing::sample_size;

std::vector<BoardView> views_of(int num_photos) {
  return testing::sample_views(testing::sample_scene(testing::sample_camera("brown"), num_photos, 1), 1);
}

std::string fault_of(const CalibrateConfig& config, const Board& board = sample_board) {
  try {
    (void)calibrate(views_of(8), sample_size, board, config);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(CalibrateFace, IsTheWholeJob) {
  const auto views = views_of(10);
  const Calibration result = calibrate(views, sample_size, sample_board);
  ASSERT_TRUE(result.verdict.ok()) << result.verdict.sentence;
  CalibrateConfig config;
  config.board_shape = BoardShape::flat;
  const CalibrateReport part = calibrate(sample_board, views, sample_size, config);
  EXPECT_EQ(params(result.camera.lens), params(part.camera.lens));
  EXPECT_EQ(result.counts.given, 10u);
  EXPECT_EQ(result.counts.used, 10u);
  EXPECT_GT(result.camera.cov(0, 0), 0.0);
}

TEST(CalibrateFace, AnswersEveryHostileNumber) {
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {std::nan(""), inf, -inf, -1.0, 1e300}) {
    CalibrateConfig config;
    config.port.gap_m = bad;
    EXPECT_THAT(fault_of(config), ::testing::HasSubstr("gap_m")) << bad;
    config = {};
    config.outlier_sigmas = -std::abs(bad);
    EXPECT_NE(fault_of(config), "") << bad;
    config = {};
    config.priors = {{.name = "fx", .value = std::nan(""), .sigma = bad}};
    EXPECT_NE(fault_of(config), "") << bad;
    Board board = sample_board;
    board.square_m = -std::abs(bad);
    EXPECT_NE(fault_of({}, board), "") << bad;
  }
}

TEST(CalibrateFace, AnswersMisspeltWords) {
  CalibrateConfig config;
  config.model = "browne";
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("'browne'"));
  config = {};
  config.fixed = {"k9"};
  EXPECT_EQ(fault_of(config), "'k9' is no parameter of model brown; it has fx, fy, cx, cy, skew, k1, k2, p1, p2, k3");
  config = {};
  config.model = "flat_port";
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("--glass"));
  config = {};
  config.port.glass_m = 0.01;
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("flat_port"));
  config = {};
  config.board_shape = BoardShape::given;
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("0 are given"));
}

TEST(CalibrateFace, AnswersCornersThatCannotBe) {
  const auto fault_with = [](const auto& spoil) -> std::string {
    auto views = views_of(8);
    spoil(views[3].corners[5]);
    try {
      (void)calibrate(views, sample_size, sample_board);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(fault_with([](Corner& corner) { corner.index = 5000; }), "");
  EXPECT_NE(fault_with([](Corner& corner) { corner.index = -1; }), "");
  EXPECT_NE(fault_with([](Corner& corner) { corner.px.x() = std::nan(""); }), "");
  EXPECT_NE(fault_with([](Corner& corner) { corner.cov(0, 0) = -1.0; }), "");
  EXPECT_NE(fault_with([](Corner& corner) { corner.cov.setZero(); }), "");
}

TEST(CalibrateFace, AnswersACornerGivenTwiceAndPointsOfNoShape) {
  auto views = views_of(8);
  views[3].corners[5].index = views[3].corners[4].index;
  EXPECT_THROW((void)calibrate(views, sample_size, sample_board), ConfigError);
  CalibrateConfig config;
  config.board_points = points_in_board(sample_board);
  EXPECT_THAT(fault_of(config), ::testing::HasSubstr("BoardShape::given"));
}

/// They were "only 15 usable photos of the board; it takes 3", exit 4.
TEST(CalibrateFace, AnswersBoardsThatCannotBe) {
  const auto fault_with = [](const auto& changed) {
    CalibrateConfig config;
    config.board_shape = BoardShape::given;
    config.board_points = points_in_board(sample_board);
    for (Eigen::Vector3d& point : config.board_points) point = changed(point);
    return fault_of(config);
  };
  const auto times = [&](double scale) {
    return fault_with([scale](const Eigen::Vector3d& X) { return Eigen::Vector3d(scale * X); });
  };
  EXPECT_EQ(fault_with([](const Eigen::Vector3d& X) -> Eigen::Vector3d { return X; }), "");
  EXPECT_EQ(times(std::nan("")), "board_points: point 0 is not finite");
  EXPECT_THAT(times(1e300), ::testing::HasSubstr("m away; they are in metres"));
  EXPECT_EQ(times(1.3), "");
  for (const double unit : {1000.0, 0.001})
    EXPECT_THAT(times(unit), ::testing::ContainsRegex("they reach .* by the board's pitch .* they are in metres"));
  EXPECT_EQ(times(0.0), "board_points: they all lie on one line, or in one place");
  EXPECT_EQ(fault_with([](const Eigen::Vector3d& X) -> Eigen::Vector3d {
              return {X.x(), 2.0 * X.x(), 0.0};
            }),
            "board_points: they all lie on one line, or in one place");
  for (const double square_m : {1e300, 1e-300}) {
    Board board = sample_board;
    board.square_m = square_m;
    EXPECT_THAT(fault_of({}, board), ::testing::HasSubstr("the pitch of a board is in metres, and not 1e")) << square_m;
  }
}

/// Whether the verdict of that calibration has a check of that name that is not good.
bool is_named(const std::string& name, const std::vector<BoardView>& views, const ImageSize& size, const Board& board) {
  const Verdict verdict = calibrate(views, size, board).verdict;
  return verdict.state == State::care && std::ranges::any_of(verdict.checks, [&name](const Check& check) {
           return check.name == name && check.state == State::care;
         });
}

/// Images of another size have corners outside: many are refused, a few are named.
TEST(CalibrateFace, SaysThatCornersLieOutsideTheImages) {
  const auto views = views_of(10);
  double right_px = 0.0;
  for (const BoardView& view : views)
    for (const Corner& corner : view.corners) right_px = std::max(right_px, corner.px.x());
  const int height_px = sample_size.height_px;
  EXPECT_FALSE(is_named("corners inside", views, sample_size, sample_board));
  EXPECT_TRUE(is_named("corners inside", views, {static_cast<int>(right_px) - 1, height_px}, sample_board));
  EXPECT_THROW((void)calibrate(views, {sample_size.width_px / 2, height_px}, sample_board), ConfigError);
}

TEST(CalibrateFace, NormalisedCoordinatesAreNoPixels) {
  for (const Eigen::Vector2d& from : {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(320.0, 240.0)}) {
    auto views = views_of(10);
    for (BoardView& view : views)
      for (Corner& corner : view.corners) corner.px = (corner.px - from) / 640.0;
    try {
      (void)calibrate(views, sample_size, sample_board);
      ADD_FAILURE() << "is taken";
    } catch (const ConfigError& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr("give them in pixels"));
    }
  }
}

/// 25 for 25 mm: the lens is right, the poses are kilometres away.
TEST(CalibrateFace, NamesSquaresOfAnotherUnit) {
  for (const double square_m : {25.0, 25e-6, sample_board.square_m}) {
    Board board = sample_board;
    board.square_m = square_m;
    EXPECT_EQ(is_named("square", views_of(10), sample_size, board), square_m != sample_board.square_m) << square_m;
  }
}

TEST(CalibrateFace, AnswersEmptyInput) {
  EXPECT_EQ(calibrate(std::vector<BoardView>{}, sample_size, sample_board).verdict.exit_code, ExitCode::undetermined);
  EXPECT_EQ(calibrate(Photos{}, sample_board).verdict.exit_code, ExitCode::undetermined);
  EXPECT_THROW((void)calibrate(std::vector<BoardView>{}, ImageSize{}, sample_board), ConfigError);
  EXPECT_THROW((void)calibrate(Photos{.names = {"a"}, .load = nullptr}, sample_board), ConfigError);
  EXPECT_EQ(find_corners(Photos{}, sample_board).verdict.exit_code, ExitCode::undetermined);
}

}  // namespace
}  // namespace alidade
