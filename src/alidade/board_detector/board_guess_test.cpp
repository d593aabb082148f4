#include "alidade/board_detector/board_guess.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"

namespace alidade {
namespace {

const Board plain{.cols = 7, .rows = 6, .square_m = 0.03};
const Board marked{BoardKind::charuco, 8, 5, 0.03, 0.022, "DICT_5X5_100"};
const Board dots{BoardKind::asymmetric_circles, 4, 9, 0.02, 0.0, ""};

/// Three photos of a board.
std::vector<cv::Mat> photos_of(const Board& board) {
  const BoardScene scene = draw_board_scene(*example_camera("brown", 800, 600), board,
                                            {.num_photos = 3, .max_tilt_rad = 0.4, .min_fill = 0.5}, 1);
  std::vector<cv::Mat> photos;
  for (std::size_t i = 0; i < 3; ++i) photos.push_back(render_board_photo(scene, i, {}, 1));
  return photos;
}

std::string guessed(const std::vector<cv::Mat>& photos, const Board& given) {
  const auto board = guess_board(
      photos.size(), [&](std::size_t i) { return photos[i]; }, given);
  return board ? changed_options(given, *board) : "";
}

Board sized(Board board, int cols, int rows) {
  board.cols = cols;
  board.rows = rows;
  return board;
}

TEST(BoardGuess, AChessboardGivenInSquaresOrOffByOne) {
  const auto photos = photos_of(plain);
  for (const auto& [cols, rows] : {std::pair{8, 7}, std::pair{6, 5}, std::pair{8, 6}, std::pair{7, 5}, std::pair{7, 7}})
    EXPECT_EQ(guessed(photos, sized(plain, cols, rows)), "--board 7x6") << cols << "x" << rows;
}

TEST(BoardGuess, ABoardWithMarkersGivenInSquaresOrWithAnotherDictionary) {
  const auto photos = photos_of(marked);
  EXPECT_EQ(guessed(photos, sized(marked, 9, 6)), "--board 8x5");
  EXPECT_EQ(guessed(photos, sized(marked, 7, 4)), "--board 8x5");
  EXPECT_EQ(guessed(photos, sized(marked, 5, 8)), "--board 8x5") << "columns and rows swapped";
  Board other = marked;
  other.dictionary = "DICT_4X4_50";
  EXPECT_EQ(guessed(photos, other), "--dictionary DICT_5X5_50");
  EXPECT_EQ(guessed(photos, sized(other, 9, 6)), "--board 8x5 --dictionary DICT_5X5_50");
}

TEST(BoardGuess, MarkersOrNone) {
  Board bare = marked;
  bare.kind = BoardKind::chessboard;
  bare.marker_m = 0.0;
  bare.dictionary.clear();
  EXPECT_EQ(guessed(photos_of(marked), bare),
            "--board-kind charuco --dictionary DICT_5X5_50 --marker with its markers' side");
  const Board with_markers{BoardKind::charuco, 7, 6, 0.03, 0.02, "DICT_5X5_100"};
  EXPECT_EQ(guessed(photos_of(plain), with_markers), "--board-kind chessboard");
}

TEST(BoardGuess, CirclesGivenTheOtherWayRound) {
  EXPECT_EQ(guessed(photos_of(dots), sized(dots, 9, 4)), "--board 4x9");
}

TEST(BoardGuess, NoneWhereThereIsNone) {
  std::vector<cv::Mat> noise(3);
  cv::theRNG().state = 5;
  for (cv::Mat& photo : noise) {
    photo.create(480, 640, CV_8UC1);
    cv::randu(photo, 0, 256);
    cv::GaussianBlur(photo, photo, {}, 2.0);
  }
  EXPECT_EQ(guessed(noise, plain), "");
  EXPECT_EQ(guessed(noise, marked), "");
  EXPECT_FALSE(guess_board(
      0, [](std::size_t) { return cv::Mat(); }, plain));
}

/// Corners of the first columns of a board, as in so many photos.
std::vector<BoardView> views_of(const Board& board, int num_cols, std::size_t num) {
  BoardView view{"photo", {}};
  for (int index = 0; index < num_points(board); ++index)
    if (index % board.cols < num_cols) view.corners.push_back({.index = index});
  return std::vector<BoardView>(num, view);
}

TEST(BoardGuess, AColumnThatNoPhotoShowsIsNone) {
  const auto wrong = smaller_board(views_of(plain, 6, 8), plain);
  ASSERT_TRUE(wrong);
  EXPECT_EQ(wrong->reason, "no photo shows the whole board of 7×6 corners, and all 8 show 6×6");
  EXPECT_EQ(wrong->to_add, "use --board 6x6 if that is the whole board");
  EXPECT_FALSE(smaller_board(views_of(plain, 7, 8), plain));
  EXPECT_FALSE(smaller_board(views_of(plain, 6, 4), plain));
  auto some = views_of(plain, 6, 8);  // parts of a board of which each photo shows another
  some[3] = views_of(plain, 5, 1).front();
  EXPECT_FALSE(smaller_board(some, plain));
  auto torn = views_of(plain, 6, 8);
  torn[2].corners.erase(torn[2].corners.begin() + 9);
  EXPECT_FALSE(smaller_board(torn, plain));
}

}  // namespace
}  // namespace alidade
