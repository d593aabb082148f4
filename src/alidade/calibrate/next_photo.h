#pragma once

#include <limits>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/estimation/progress.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A board pose to photograph next, and the expected uncertainty with it.
struct NextPhoto {
  Rigid3 cam_from_board;
  double worst_3sigma_px = 0.0;  ///< Worst 3σ of projection over the image with this photo added.
};

struct NextPhotoPlan {
  double worst_3sigma_px = 0.0;   ///< With the photos taken so far.
  std::vector<NextPhoto> photos;  ///< In the order in which to take them; each assumes those before it.
};

/// Chooses, from board poses all over the image, at two distances and five tilts, the one that lowers the worst 3σ of
/// projection most; then the next, and so on. Greedy experimental design on the information matrix of the lens:
/// Λ' = Λ + (A − W V⁻¹ Wᵀ)/σ², with the candidate's pose eliminated. No pose is proposed twice. `camera.cov` and
/// `noise_px` come from the calibration. Fedorov, "Theory of optimal experiments", 1972 (sequential G-optimal design).
[[nodiscard]] NextPhotoPlan plan_next_photos(const Camera& camera, double noise_px,
                                             const std::vector<Eigen::Vector3d>& board_points, int num_photos,
                                             const Progress& progress = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
