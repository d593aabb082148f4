#include "alidade/capture/outline.h"

#include <Eigen/Geometry>

namespace alidade {

std::vector<Eigen::Vector2d> outline_of(const Camera& camera, const std::vector<Eigen::Vector3d>& board_points,
                                        const Rigid3& cam_from_board) {
  Eigen::AlignedBox3d box;
  for (const auto& point : board_points) box.extend(point);
  const Eigen::Vector3d low = box.min(), high = box.max();
  const std::vector<Eigen::Vector3d> rim{low, {high.x(), low.y(), 0}, {high.x(), high.y(), 0}, {low.x(), high.y(), 0}};
  std::vector<Eigen::Vector2d> outline;
  constexpr int steps = 6;
  for (std::size_t side = 0; side < 4; ++side) {
    for (int step = 0; step < steps; ++step) {
      const double way = static_cast<double>(step) / steps;
      const auto px =
          project(camera, cam_from_board * Eigen::Vector3d((1.0 - way) * rim[side] + way * rim[(side + 1) % 4]));
      if (px) outline.push_back(*px);
    }
  }
  return outline;
}

}  // namespace alidade
