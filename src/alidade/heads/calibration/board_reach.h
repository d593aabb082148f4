#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <span>

#include "alidade/patches/point_tracks.h"

namespace alidade {

/// Where a head may go so that all of a board stays in its camera's image.
class BoardReach {
 public:
  /// The board as it is seen at `pan_tilt_rad`.
  BoardReach(std::span<const TrackedPoint> corners, const Eigen::Vector2d& pan_tilt_rad, int width_px, int height_px);
  /// One position after the other: to the edges, to the corners, and half as far.
  [[nodiscard]] Eigen::Vector2d next(double focal_px);
  /// The board was lost on the last way: from now on less far.
  void shrink() { reach_ *= 0.75; }
  [[nodiscard]] const Eigen::Vector2d& home_rad() const { return home_rad_; }

 private:
  Eigen::AlignedBox2d box_;
  Eigen::Vector2d home_rad_, size_px_;
  double reach_ = 0.85;
  std::size_t num_offsets_ = 0;
};

}  // namespace alidade
