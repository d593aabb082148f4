#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// One board point as seen: which one, where, and how well.
struct Corner {
  int index = 0;                                 ///< Number of the point on the board.
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< (0, 0) is the centre of the top-left pixel.
  Eigen::Matrix2d cov =
      Eigen::Matrix2d::Identity();  ///< Covariance of `px` [px²]; the identity where nothing is known.
};

/// The board in one photo. Partial boards have fewer corners than the board has points.
struct BoardView {
  std::string photo;  ///< File name as given.
  std::vector<Corner> corners;
};

/// What is wrong with a view's corners, of a board of so many points: a number that it has not, a corner that appears
/// twice, a position that is not finite. Empty where nothing is.
[[nodiscard]] std::string corners_fault(const BoardView& view, int num_points);

ALIDADE_PUBLIC_END
}  // namespace alidade
