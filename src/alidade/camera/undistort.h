#pragma once

#include <vector>

#include "alidade/camera/camera.h"

namespace alidade {

/// The pinhole that an image is undistorted to: same size, principal point and skew 0, focal lengths times `zoom`
/// (below 1 shows more of a wide image, with black where the lens sees nothing).
[[nodiscard]] Camera undistorted_camera(const Camera& camera, double zoom = 1.0);

/// For each pixel of `target`, row by row, where `source` sees the same direction; (−1, −1) where it does not, or where
/// that is outside its image. float, as image libraries want it: 1e-4 px at 2000 px.
struct PixelMap {
  int width_px = 0;
  int height_px = 0;
  std::vector<float> u_px, v_px;
};
[[nodiscard]] PixelMap undistortion_map(const Camera& source, const Camera& target);

/// Full angles of view through the principal point [rad]; NaN where the edge sees nothing.
struct FieldOfView {
  double horizontal_rad = 0.0, vertical_rad = 0.0, diagonal_rad = 0.0;
};
[[nodiscard]] FieldOfView field_of_view(const Camera& camera);

}  // namespace alidade
