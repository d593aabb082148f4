#pragma once

#include <Eigen/Core>
#include <map>
#include <span>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/estimation/counts.h"
#include "alidade/pantilt/head_view.h"

namespace alidade {

/// Views without the corners that are elsewhere than the other corners of their view say.
struct CheckedCorners {
  std::vector<HeadView> views;
  std::vector<SkippedInput> wrong;  ///< One a view that lacks some now: which, and how far off they were.
};
/// A corner is wrong beyond 7 σ (of half of all corners) from where its view's others put it, where its neighbours on
/// the board are not: what a lens or a bent board does, neighbours share. Where more than a tenth of the corners would
/// be wrong, or a fifth of a view's, they are left: then something else is. Views of a head without a camera stay as
/// they are.
[[nodiscard]] CheckedCorners without_wrong_corners(std::span<const HeadView> views,
                                                   std::span<const Eigen::Vector3d> points_in_board,
                                                   const std::map<int, Camera>& cameras);

}  // namespace alidade
