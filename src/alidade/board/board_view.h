#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// One observed board point: its number, pixel and covariance.
struct Corner {
  int index = 0;                                 ///< Number of the point on the board.
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< (0, 0) is the centre of the top-left pixel.
  Eigen::Matrix2d cov =
      Eigen::Matrix2d::Identity();  ///< Covariance of `px` [px²]; the identity where nothing is known.
};

/// The board in one photo. A partly visible board has fewer corners than board points.
struct BoardView {
  std::string photo;  ///< File name as given.
  std::vector<Corner> corners;
};

/// What is wrong with the corners of a view of a board with `num_points` points: an invalid index, a corner that occurs
/// twice, or a position that is not finite. Empty if nothing is wrong.
[[nodiscard]] std::string corners_fault(const BoardView& view, int num_points);

ALIDADE_PUBLIC_END
}  // namespace alidade
