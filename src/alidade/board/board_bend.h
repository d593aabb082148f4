#pragma once

#include <Eigen/Core>
#include <span>

namespace alidade {

/// Modes in which a board may bend, relative to the bounding box of its printed points: heights above its plane that
/// are 1 in the centre and 0 at the border for a bow along x or along y, and 1 and −1 at the corners for a twist.
class BoardBend {
 public:
  explicit BoardBend(std::span<const Eigen::Vector3d> printed_points);
  [[nodiscard]] Eigen::Vector3d heights_at(const Eigen::Vector3d& point_in_board) const;

 private:
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero(), half_ = Eigen::Vector3d::Ones();
};

}  // namespace alidade
