#include "alidade/board/board_bend.h"

#include <Eigen/Geometry>

namespace alidade {

BoardBend::BoardBend(std::span<const Eigen::Vector3d> printed_points) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : printed_points) box.extend(point);
  if (box.isEmpty()) return;
  centre_ = box.center();
  half_ = 0.5 * box.sizes().cwiseMax(1e-12);
}

Eigen::Vector3d BoardBend::heights_at(const Eigen::Vector3d& point_in_board) const {
  const Eigen::Vector3d q = (point_in_board - centre_).cwiseQuotient(half_);
  return {1.0 - q.x() * q.x(), 1.0 - q.y() * q.y(), q.x() * q.y()};
}

}  // namespace alidade
