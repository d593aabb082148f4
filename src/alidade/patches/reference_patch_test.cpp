#include "alidade/patches/reference_patch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/camera/camera.h"
#include "alidade/imaging/rectangles.h"
#include "alidade/patches/corner_features.h"
#include "alidade/testing/room_video.h"

namespace alidade {
namespace {

using testing::render_room;
using testing::room_camera;
using testing::room_path;
using testing::RoomScene;

/// A smooth surface of grey values, seen through a map: exact at every subpixel position.
cv::Mat waves(const Eigen::Matrix2d& A, const Eigen::Vector2d& t) {
  cv::Mat image(120, 120, CV_8U);
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 120; ++u) {
      const Eigen::Vector2d p = A * (Eigen::Vector2d(u, v) - t);
      const double grey = 128 + 40 * std::sin(0.55 * p.x() + 0.2 * p.y()) + 40 * std::cos(0.5 * p.y() - 0.15 * p.x()) +
                          20 * std::sin(0.31 * p.x() * 0.7 + 0.23 * p.y());
      image.at<std::uint8_t>(v, u) = cv::saturate_cast<std::uint8_t>(grey);
    }
  }
  return image;
}

TEST(ReferencePatch, IsFoundBetweenPixelsThroughItsWarp) {
  const cv::Mat first = smoothed_for_search(waves(Eigen::Matrix2d::Identity(), {60, 60}));
  const ReferencePatch patch(first, 60, 60);
  Eigen::Matrix2d here_from_first;
  here_from_first << 1.1, 0.15, -0.1, 0.95;
  for (const Eigen::Vector2d& shift :
       {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(0.3, -0.4), Eigen::Vector2d(-2.6, 1.7)}) {
    const Eigen::Vector2d truth = Eigen::Vector2d(60, 60) + shift;
    const cv::Mat now = smoothed_for_search(waves(here_from_first.inverse(), truth));
    const auto view = patch.seen_through(here_from_first);
    ASSERT_TRUE(view);
    const auto match = find_patch(now, *view, {60, 60}, 2.0 * Eigen::Matrix2d::Identity());
    ASSERT_TRUE(match);
    EXPECT_LT((match->px - truth).norm(), 0.05);  // bilinear samples of rounded greys
    EXPECT_GT(match->correlation, 0.98);
  }
}

TEST(ReferencePatch, IsLookedForInsideTheEllipseOnly) {
  const cv::Mat first = smoothed_for_search(waves(Eigen::Matrix2d::Identity(), {60, 60}));
  const ReferencePatch patch(first, 60, 60);
  const auto view = patch.seen_through(Eigen::Matrix2d::Identity());
  ASSERT_TRUE(view);
  const Eigen::Matrix2d S = Eigen::Vector2d(4.0, 1.0).asDiagonal();
  const auto match = find_patch(first, *view, {60, 60}, S);
  ASSERT_TRUE(match);
  EXPECT_NEAR(match->num_compared, M_PI * 6.0 * 3.0, 8.0);  // π ab, less what the pixels' grid leaves
  EXPECT_FALSE(find_patch(first, *view, {66, 60}, Eigen::Matrix2d::Identity()));  // 6 px away, 3 are looked at
  EXPECT_FALSE(find_patch(first, *view, {2, 2}, S));                              // outside
}

TEST(ReferencePatch, OfAPlainWallIsNone) {
  const cv::Mat plain(60, 60, CV_8U, cv::Scalar(90));
  EXPECT_FALSE(ReferencePatch(plain, 30, 30).seen_through(Eigen::Matrix2d::Identity()));
  const cv::Mat first = smoothed_for_search(waves(Eigen::Matrix2d::Identity(), {60, 60}));
  EXPECT_FALSE(ReferencePatch(first, 60, 60).seen_through(3.0 * Eigen::Matrix2d::Identity()));
}

TEST(CornerFeatures, AreSpreadAndKeepAwayFromOthers) {
  RoomScene scene;
  scene.camera = room_camera();
  const cv::Mat image = smoothed_for_search(render_room(scene, room_path(scene).front(), 1));
  const std::vector<Eigen::Vector2d> taken{{100, 100}, {200, 60}};
  const auto corners = corners_in_empty_cells(image, taken);
  EXPECT_GT(corners.size(), 20u);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d px = corners[i].px.cast<double>();
    for (const Eigen::Vector2d& other : taken) EXPECT_GE((px - other).norm(), 16.0);
    for (std::size_t k = 0; k < i; ++k) EXPECT_GE((px - corners[k].px.cast<double>()).norm(), 16.0);
    EXPECT_LE(corners[i].strength, corners[i > 0 ? i - 1 : 0].strength);
  }
}

TEST(Rectangles, CornersStandWhereTheLensPutsThem) {
  RoomScene scene;
  scene.camera = room_camera();
  int num_checked = 0;
  for (const Rigid3& world_from_cam : {room_path(scene)[0], room_path(scene)[30], room_path(scene)[60]}) {
    const auto found = find_rectangles(render_room(scene, world_from_cam, 3), scene.camera);
    double best = 1e9;
    for (const SeenRectangle& seen : found) {
      double worst = 0.0;
      for (std::size_t k = 0; k < 4; ++k) {
        const double x = k == 1 || k == 2 ? 0.105 : -0.105, y = k >= 2 ? 0.07425 : -0.07425;
        const auto px = project(scene.camera, world_from_cam.inverse() * Eigen::Vector3d(x, y, 0.0));
        worst = std::max(worst, (*px - seen.corners_px[k]).norm());
      }
      best = std::min(best, worst);
    }
    EXPECT_LT(best, 0.3);  // a fifth of the edge's width, noise 2
    ++num_checked;
  }
  EXPECT_EQ(num_checked, 3);
}

}  // namespace
}  // namespace alidade
