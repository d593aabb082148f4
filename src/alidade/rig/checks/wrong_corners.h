#pragma once

#include <Eigen/Core>
#include <map>
#include <span>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/estimation/counts.h"
#include "alidade/pantilt/head_view.h"

namespace alidade {

/// Views without the corners that contradict the other corners of their view.
struct CheckedCorners {
  std::vector<HeadView> views;
  std::vector<SkippedInput> wrong;  ///< One per view that lost some: which, and how far off they were.
};
/// A corner is wrong if it is more than 7 σ (of half of all corners) from where the others of its view predict it, and
/// its neighbours on the board are not: errors of a lens or a bent board are shared by neighbours. If more than a tenth
/// of the corners would be wrong, or a fifth of a view's, they are kept: the cause is another. Views of a head without
/// a camera are unchanged.
[[nodiscard]] CheckedCorners without_wrong_corners(std::span<const HeadView> views,
                                                   std::span<const Eigen::Vector3d> points_in_board,
                                                   const std::map<int, Camera>& cameras);

}  // namespace alidade
