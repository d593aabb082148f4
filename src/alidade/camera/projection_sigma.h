#pragma once

#include "alidade/camera/camera.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Values over the image on a regular grid of pixels: value (col, row) stands at (u0 + col·du, v0 + row·dv).
struct PixelGrid {
  int cols = 0, rows = 0;
  double u0_px = 0.0, v0_px = 0.0, du_px = 1.0, dv_px = 1.0;
  std::vector<double> values;  ///< Row-major; NaN where there is none (outside the lens' valid domain).

  [[nodiscard]] Eigen::Vector2d px(int col, int row) const { return {u0_px + col * du_px, v0_px + row * dv_px}; }
};

/// A grid without values that reaches from the centre of the first pixel to the centre of the last.
[[nodiscard]] PixelGrid make_grid(int width_px, int height_px, int cols, int rows);

/// Standard deviation [px] of where a fixed direction is seen, over the image: the largest axis of
/// J Σ Jᵀ after the best-fitting rigid motion of the camera is removed, as that motion is taken up by the poses.
/// `distance_m`: infinity removes a rotation only; a finite working distance removes rotation and translation.
/// The fit weighs each pixel of the grid by 1/σ², with σ of an unweighted fit.
/// `camera.cov` must be given: all NaN without it. D. Kogan, mrcal, "Projection uncertainty" (implied rotation),
/// derived in docs/maths/camera-models.md.
[[nodiscard]] PixelGrid projection_sigma(const Camera& camera, int cols, int rows, double distance_m);

ALIDADE_PUBLIC_END
}  // namespace alidade
