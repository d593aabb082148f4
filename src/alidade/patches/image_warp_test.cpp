#include "alidade/patches/image_warp.h"

#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "alidade/testing/random.h"

namespace alidade {
namespace {

/// A rotation of 0.15 rad of a camera of f = 500: the homography of its perspective.
Eigen::Vector2d turned(const Eigen::Vector2d& px) {
  const double x = (px.x() - 320.0) / 500.0, y = (px.y() - 240.0) / 500.0, c = std::cos(0.15), s = std::sin(0.15);
  const double depth = c - s * x;
  return {320.0 + 500.0 * (c * x + s) / depth, 240.0 + 500.0 * y / depth};
}

std::vector<PointMove> moves_of(int count, std::mt19937_64& rng) {
  std::uniform_real_distribution<double> x(10.0, 630.0), y(10.0, 470.0);
  std::vector<PointMove> moves;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d from(x(rng), y(rng));
    moves.push_back({from, turned(from)});
  }
  return moves;
}

TEST(ImageWarp, HasTheBendOfPerspective) {
  std::mt19937_64 rng = testing::make_rng();
  std::vector<PointMove> moves = moves_of(100, rng);
  for (std::size_t i = 0; i < 10; ++i) moves[10 * i].to_px += Eigen::Vector2d(30.0, -20.0);  // went astray
  const auto warp = ImageWarp::fit(moves);
  ASSERT_TRUE(warp.has_value());
  for (const Eigen::Vector2d& px : {Eigen::Vector2d(320.0, 240.0), {150.0, 350.0}, {500.0, 120.0}}) {
    constexpr double h = 1.0;
    const Eigen::Vector2d dx(h, 0.0), dy(0.0, h);
    WarpBend truth;
    truth << turned(px + dx) - 2.0 * turned(px) + turned(px - dx),
        0.25 * (turned(px + dx + dy) - turned(px + dx - dy) - turned(px - dx + dy) + turned(px - dx - dy)),
        turned(px + dy) - 2.0 * turned(px) + turned(px - dy);
    EXPECT_LT((warp->at(px) - turned(px)).norm(), 0.2);  // fourth order
    EXPECT_LT((warp->bend_at(px) - truth).norm(), 0.25 * truth.norm());
  }
}

TEST(ImageWarp, SaysWhenPointsAreDegenerate) {
  std::mt19937_64 rng = testing::make_rng();
  EXPECT_FALSE(ImageWarp::fit(moves_of(12, rng)).has_value());
  std::vector<PointMove> on_a_line = moves_of(50, rng);
  for (PointMove& move : on_a_line) move.from_px.y() = 100.0;
  EXPECT_FALSE(ImageWarp::fit(on_a_line).has_value());
}

}  // namespace
}  // namespace alidade
