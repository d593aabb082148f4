#include <algorithm>
#include <cmath>

#include "alidade/observe/solve/solve.h"

namespace alidade {

PixelScale pixel_scale(const RotationLog& log, int& width_px, int& height_px) {
  double width = width_px, height = height_px;
  if (width_px <= 0 || height_px <= 0) {
    width = height = 1.0;
    for (const RotationRow& row : log.rows) {
      for (const Eigen::Vector2d& px : row.px) {
        if (!is_seen(px)) continue;
        width = std::max(width, px.x());
        height = std::max(height, px.y());
      }
    }
    width = std::ceil(std::min(width, 1e6)) + 1.0;
    height = std::ceil(std::min(height, 1e6)) + 1.0;
    width_px = static_cast<int>(width);
    height_px = static_cast<int>(height);
  }
  return {Eigen::Vector2d(0.5 * (width - 1.0), 0.5 * (height - 1.0)), 0.5 * width};
}

}  // namespace alidade
