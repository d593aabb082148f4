#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "alidade/board_detector/find_boards.h"

namespace alidade {
namespace {

namespace fs = std::filesystem;

/// A set of external photos: how many boards are found in it, and how many completely.
struct PhotoSet {
  const char *name, *folder, *extension;
  int cols, rows;
  std::size_t photos, min_found, min_whole;
};

class RealChessboards : public ::testing::TestWithParam<PhotoSet> {};

TEST_P(RealChessboards, AreFound) {
  const char* root = std::getenv("ALIDADE_DATA");
  if (!root) GTEST_SKIP() << "set ALIDADE_DATA to the folder with data/ to test real photos";
  const PhotoSet& set = GetParam();
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(fs::path(root) / "data" / set.folder)) {
    if (entry.path().extension() == set.extension) files.push_back(entry.path().string());
  }
  ASSERT_EQ(files.size(), set.photos);
  const Board board{.kind = BoardKind::chessboard, .cols = set.cols, .rows = set.rows, .square_m = 0.03};
  const auto found = find_boards(
      files.size(), [&](std::size_t i) { return cv::imread(files[i], cv::IMREAD_UNCHANGED); }, board);
  std::size_t num_found = 0, num_whole = 0;
  for (std::size_t i = 0; i < files.size(); ++i) {
    num_found += found.photos[i].found() ? 1u : 0u;
    num_whole += found.photos[i].view.corners.size() == static_cast<std::size_t>(set.cols * set.rows) ? 1u : 0u;
    EXPECT_EQ(found.photos[i].found(), !found.photos[i].view.corners.empty()) << files[i];
  }
  EXPECT_GE(num_found, set.min_found);
  EXPECT_GE(num_whole, set.min_whole);
}

// Of the wide set two photos show a part of the board only; of the rangefinder's, one is dazzled.
INSTANTIATE_TEST_SUITE_P(Sets, RealChessboards,
                         ::testing::Values(PhotoSet{"stereo", "bouguet-stereo5", ".jpg", 9, 6, 28, 28, 28},
                                           PhotoSet{"example", "bouguet-example1", ".tif", 13, 12, 25, 25, 25},
                                           PhotoSet{"example_turned", "bouguet-example1", ".tif", 12, 13, 25, 25, 25},
                                           PhotoSet{"wide", "udacity-wide", ".jpg", 8, 6, 37, 35, 32},
                                           PhotoSet{"air", "underwater-dome/air1100", ".png", 8, 6, 12, 12, 12},
                                           PhotoSet{"water", "underwater-dome/underwater1100", ".png", 8, 6, 6, 6, 6},
                                           PhotoSet{"far", "lidar1d-giubilato/images", ".png", 8, 6, 37, 36, 34},
                                           PhotoSet{"laser", "lcct-laser3d", ".jpg", 7, 5, 15, 15, 15}),
                         [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace alidade
