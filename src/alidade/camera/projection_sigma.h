#pragma once

#include "alidade/camera/camera.h"

namespace alidade {

/// Values over the picture on a regular grid of pixels: value (col, row) stands at (u0 + col·du, v0 + row·dv).
struct PixelGrid {
  int cols = 0, rows = 0;
  double u0_px = 0.0, v0_px = 0.0, du_px = 1.0, dv_px = 1.0;
  std::vector<double> values;  ///< Row-major; NaN where there is none (outside the lens' valid domain).
};

/// Standard deviation [px] of where a fixed direction is seen, over the picture: the largest axis of
/// J Σ Jᵀ after the best-fitting rigid motion of the camera is removed, as that motion is taken up by the poses.
/// `distance_m`: infinity removes a rotation only; a finite working distance removes rotation and translation.
/// `camera.cov` must be given. D. Kogan, mrcal, "Projection uncertainty" (implied rotation), derived in
/// docs/maths/board-calibration.md.
[[nodiscard]] PixelGrid projection_sigma(const Camera& camera, int cols, int rows, double distance_m);

}  // namespace alidade
