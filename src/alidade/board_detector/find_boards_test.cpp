#include "alidade/board_detector/find_boards.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <opencv2/core.hpp>
#include <stdexcept>

#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/example_camera.h"

namespace alidade {
namespace {

class FindBoards : public ::testing::Test {
 protected:
  static constexpr std::size_t num_photos = 6, unreadable = 3;

  void SetUp() override {
    const BoardScene scene =
        draw_board_scene(example_camera("brown", 640, 480).value(), board, {.num_photos = num_photos}, 3);
    for (std::size_t i = 0; i < num_photos; ++i) photos.push_back(render_board_photo(scene, i, {}, i));
  }

  [[nodiscard]] PhotoLoader loader() const {
    return [this](std::size_t i) {
      if (i == unreadable) throw std::runtime_error("photo 3 cannot be read");
      return photos[i];
    };
  }

  Board board{.kind = BoardKind::chessboard, .cols = 9, .rows = 6, .square_m = 0.03};
  std::vector<cv::Mat> photos;
};

TEST_F(FindBoards, AnswersInOrderAndTheSameOnOneThread) {
  const BoardDetections many = find_boards(num_photos, loader(), board);
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  const BoardDetections one = find_boards(num_photos, loader(), board);
  ASSERT_EQ(many.photos.size(), num_photos);
  for (std::size_t i = 0; i < num_photos; ++i) {
    EXPECT_EQ(many.photos[i].reason, i == unreadable ? "photo 3 cannot be read" : "");
    EXPECT_EQ(many.sizes[i].width_px, i == unreadable ? 0 : photos[i].cols);
    ASSERT_EQ(many.photos[i].view.corners.size(), one.photos[i].view.corners.size());
    for (std::size_t k = 0; k < one.photos[i].view.corners.size(); ++k) {
      EXPECT_EQ(many.photos[i].view.corners[k].px, one.photos[i].view.corners[k].px);
      EXPECT_EQ(many.photos[i].view.corners[k].cov, one.photos[i].view.corners[k].cov);
    }
  }
}

TEST_F(FindBoards, StopsWhenAsked) {
  std::size_t calls = 0;
  const Progress stop_at_once = [&](std::string_view, std::size_t, std::size_t) { return ++calls == 0; };
  EXPECT_THROW((void)find_boards(num_photos, loader(), board, false, stop_at_once), Interrupted);
}

TEST_F(FindBoards, HasNothingToSayOfNoPhotos) { EXPECT_TRUE(find_boards(0, loader(), board).photos.empty()); }

}  // namespace
}  // namespace alidade
