#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "alidade/board/board_view.h"

namespace alidade::testing {

/// Errors of found against true points, over the photos of a scene.
struct PointScore {
  int num_points = 0, num_found = 0;
  double sum_squares = 0.0, sum_chi2 = 0.0, worst_px = 0.0;
  [[nodiscard]] double rms_px() const { return std::sqrt(sum_squares / (2 * num_found)); }
  [[nodiscard]] double chi2_per_dof() const { return sum_chi2 / (2 * num_found); }

  void add(const BoardView& view, const std::vector<Eigen::Vector2d>& truth) {
    num_points += static_cast<int>(truth.size());
    for (const Corner& corner : view.corners) {
      const Eigen::Vector2d error = corner.px - truth[static_cast<std::size_t>(corner.index)];
      sum_squares += error.squaredNorm();
      sum_chi2 += error.dot(corner.cov.inverse() * error);
      worst_px = std::max(worst_px, error.norm());
      ++num_found;
    }
  }
};

}  // namespace alidade::testing
