#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/solve/bundle.h"

namespace alidade {

/// An initial lens, with the poses that were refined together with it.
struct InitialLens {
  Lens lens;
  std::vector<std::optional<Rigid3>> cam_from_board;  ///< One per view; none if the corners do not fit.
};

/// Initial lens for the bundle adjustment, without a guess by the user: Zhang's closed form, else one focal length
/// from vanishing points, else a ladder of focal lengths; each is refined on the given views and the best fit is used.
/// `free_lens`, `prior_*`: as in BundleProblem. None if no initial guess converges.
[[nodiscard]] std::optional<InitialLens> initial_lens(std::span<const BoardView> views,
                                                      const std::vector<Eigen::Vector3d>& board_points, ImageSize size,
                                                      const Lens& held, const BundleProblem& settings);

/// Largest angle [rad] between the normals of the boards. Boards in a single orientation do not determine the
/// focal length, whatever lens is assumed (Zhang 2000, §4.2); the poses may come from a wrong one.
[[nodiscard]] double spread_of_normals_rad(std::span<const Rigid3> cam_from_board);

}  // namespace alidade
