#include "alidade/calibrate/far_corners.h"

#include <gtest/gtest.h>

#include "alidade/testing/calibration_sample.h"

namespace alidade {
namespace {

using testing::sample_board;
using testing::sample_camera;
using testing::sample_scene;
using testing::sample_views;

TEST(FarCorners, AreFoundAmongManyAndFewAndNowhereElse) {
  const std::vector<Eigen::Vector3d> points = points_in_board(sample_board);
  for (BoardView view : sample_views(sample_scene(sample_camera("brown"), 40, 5), 5)) {
    for (const std::size_t count : {54u, 30u, 12u, 7u, 6u}) {  // whole rows, a part of one
      view.corners.resize(count);
      EXPECT_TRUE(far_corners(view, points).empty()) << count;
      for (const double away_px : {8e3, -1e5, 1e300}) {
        BoardView wrong = view;
        wrong.corners[count / 3].px.y() += away_px;
        const auto far = far_corners(wrong, points);
        ASSERT_EQ(far.size(), count) << away_px;
        for (std::size_t i = 0; i < count; ++i) EXPECT_EQ(far[i], i == count / 3) << count << " " << away_px;
        EXPECT_EQ(without(wrong, far).corners.size(), count - 1);
      }
    }
  }
}

}  // namespace
}  // namespace alidade
