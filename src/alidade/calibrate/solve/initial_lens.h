#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/solve/bundle.h"

namespace alidade {

/// A lens to start from, with the poses that were refined together with it.
struct InitialLens {
  Lens lens;
  std::vector<std::optional<Rigid3>> cam_from_board;  ///< One per view; none where the corners do not fit.
};

/// First lens for the bundle adjustment, without any guess from the user: Zhang's closed form, else one focal length
/// from vanishing points, else a ladder of focal lengths; each is refined on the views given and the best fit wins.
/// `free_lens`, `prior_*`: as in BundleProblem. None where no start leads anywhere.
[[nodiscard]] std::optional<InitialLens> initial_lens(std::span<const BoardView> views,
                                                      const std::vector<Eigen::Vector3d>& board_points, ImageSize size,
                                                      const Lens& held, const BundleProblem& settings);

/// Largest angle [rad] between the normals of the boards. Boards seen in one orientation alone do not determine the
/// focal length, whatever lens is assumed (Zhang 2000, §4.2); the poses may come from a wrong one.
[[nodiscard]] double spread_of_normals_rad(std::span<const Rigid3> cam_from_board);

}  // namespace alidade
