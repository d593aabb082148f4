#include "alidade/heads/calibration/board_reach.h"

#include <algorithm>
#include <array>

namespace alidade {

BoardReach::BoardReach(std::span<const TrackedPoint> corners, const Eigen::Vector2d& pan_tilt_rad, int width_px,
                       int height_px)
    : home_rad_(pan_tilt_rad), size_px_(width_px, height_px) {
  for (const TrackedPoint& corner : corners) box_.extend(corner.px);
}

Eigen::Vector2d BoardReach::next(double focal_px) {
  constexpr double margin_share = 0.1;  // of the board: what is printed around its corners
  static constexpr std::array<std::array<double, 2>, 14> offsets{{{1, 0},
                                                                  {0, 1},
                                                                  {-1, 0},
                                                                  {0, -1},
                                                                  {1, 1},
                                                                  {-1, -1},
                                                                  {1, -1},
                                                                  {-1, 1},
                                                                  {0.5, 0.5},
                                                                  {-0.5, -0.5},
                                                                  {0.5, -0.5},
                                                                  {-0.5, 0.5},
                                                                  {0, 0.9},
                                                                  {0.9, 0}}};
  const auto& offset = offsets[num_offsets_++ % offsets.size()];
  const Eigen::Vector2d margin = margin_share * box_.sizes();
  const Eigen::Vector2d before = (box_.min() - margin).cwiseMax(0.0);
  const Eigen::Vector2d behind = (size_px_ - box_.max() - margin).cwiseMax(0.0);
  Eigen::Vector2d target = home_rad_;
  // What is in the image goes right as the head turns left, and down as it turns up.
  for (Eigen::Index i = 0; i < 2; ++i) {
    const double way = offset[static_cast<std::size_t>(i)];
    target[i] += reach_ * way * (way > 0.0 ? behind[i] : before[i]) / focal_px;
  }
  return target;
}

}  // namespace alidade
