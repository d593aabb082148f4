#include <gtest/gtest.h>

#include "alidade/simulate/rotation.h"

namespace alidade {
namespace {

/// Where no six points make wide triangles, narrower ones do; in a tiny image the margin is narrower as well.
TEST(DrawPoints, EndsInASmallImage) {
  for (const auto& [width, height] : {std::pair{320, 240}, std::pair{64, 48}}) {
    const auto points = draw_points(width, height, 20, 7);
    ASSERT_EQ(points.size(), 20u);
    for (const Eigen::Vector2d& px : points) {
      EXPECT_TRUE(px.x() > 0.0 && px.x() < width && px.y() > 0.0 && px.y() < height);
    }
  }
}

}  // namespace
}  // namespace alidade
