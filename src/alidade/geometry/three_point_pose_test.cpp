#include "alidade/geometry/three_point_pose.h"

#include <gtest/gtest.h>

#include <random>

namespace alidade {
namespace {

Eigen::Vector3d drawn(std::mt19937_64& bits, double size) {
  std::uniform_real_distribution<double> uniform(-size, size);
  const double x = uniform(bits), y = uniform(bits), z = uniform(bits);
  return {x, y, z};
}

/// The pose from which the rays were taken is among those found, and from each of them the points lie on the rays.
TEST(ThreePointPose, FindsThePoseThatTheRaysCameFrom) {
  std::mt19937_64 bits(7);
  constexpr int num_draws = 2000;
  int num_found = 0;
  for (int i = 0; i < num_draws; ++i) {
    Rigid3 world_from_cam;
    world_from_cam.translation = drawn(bits, 2.0);
    const Eigen::Vector3d turn = drawn(bits, 1.5);
    world_from_cam.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized());
    std::array<Eigen::Vector3d, 3> points, rays;
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d in_cam = drawn(bits, 1.0) + Eigen::Vector3d(0.0, 0.0, 2.0);
      points[k] = world_from_cam * in_cam;
      rays[k] = 3.0 * in_cam;
    }
    bool is_found = false;
    const std::vector<Rigid3> poses = three_point_poses(points, rays);
    EXPECT_LE(poses.size(), 4u);
    for (const Rigid3& pose : poses) {
      is_found = is_found || (pose.translation - world_from_cam.translation).norm() < 1e-4;
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_LT((pose.inverse() * points[k]).normalized().cross(rays[k].normalized()).norm(), 1e-6) << i;
    }
    num_found += is_found ? 1 : 0;
  }
  EXPECT_GE(num_found, num_draws * 995 / 1000);  // near the cylinder through the points two poses become one
}

TEST(ThreePointPose, OnALineThereIsNone) {
  const Eigen::Vector3d step(0.1, 0.2, 0.0), from(0.0, 0.0, 2.0);
  EXPECT_TRUE(
      three_point_poses({from, from + step, from + 2.0 * step}, {from, from + step, from + 2.0 * step}).empty());
  EXPECT_TRUE(three_point_poses({from, from, from + step}, {from, from, from + step}).empty());
}

}  // namespace
}  // namespace alidade
