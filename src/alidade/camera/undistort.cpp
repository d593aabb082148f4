#include "alidade/camera/undistort.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace alidade {

Camera undistorted_camera(const Camera& camera, double zoom) {
  const Eigen::VectorXd values = params(camera.lens);
  Camera undistorted;
  undistorted.width_px = camera.width_px;
  undistorted.height_px = camera.height_px;
  undistorted.lens = Calibrated<Pinhole>{{zoom * values[0], zoom * values[1], values[2], values[3], 0.0}};
  return undistorted;
}

PixelMap undistortion_map(const Camera& source, const Camera& target) {
  PixelMap map{target.width_px, target.height_px, {}, {}};
  std::vector<Eigen::Vector2d> row_px(static_cast<std::size_t>(target.width_px));
  std::vector<Eigen::Vector3d> rays_in_cam(row_px.size());
  for (int v = 0; v < target.height_px; ++v) {  // a row at a time: one dispatch, little memory
    for (std::size_t u = 0; u < row_px.size(); ++u) row_px[u] = {static_cast<double>(u), static_cast<double>(v)};
    const std::vector<std::optional<Eigen::Vector3d>> rays = unproject(target, row_px);
    for (std::size_t u = 0; u < rays.size(); ++u) {
      rays_in_cam[u] = rays[u].value_or(Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    }
    for (const std::optional<Eigen::Vector2d>& px : project(source, rays_in_cam)) {
      const bool is_inside = px && px->x() >= -0.5 && px->y() >= -0.5 && px->x() <= source.width_px - 0.5 &&
                             px->y() <= source.height_px - 0.5;
      map.u_px.push_back(is_inside ? static_cast<float>(px->x()) : -1.0f);
      map.v_px.push_back(is_inside ? static_cast<float>(px->y()) : -1.0f);
    }
  }
  return map;
}

FieldOfView field_of_view(const Camera& camera) {
  const Eigen::VectorXd values = params(camera.lens);
  const double left = -0.5, right = camera.width_px - 0.5, top = -0.5, bottom = camera.height_px - 0.5;
  const auto off_axis_rad = [&](double u, double v) {
    const std::optional<Eigen::Vector3d> ray = unproject(camera, Eigen::Vector2d(u, v));
    return ray ? std::atan2(ray->head<2>().norm(), ray->z()) : std::numeric_limits<double>::quiet_NaN();
  };
  const double one = off_axis_rad(left, top) + off_axis_rad(right, bottom);
  const double other = off_axis_rad(right, top) + off_axis_rad(left, bottom);
  return {off_axis_rad(left, values[3]) + off_axis_rad(right, values[3]),
          off_axis_rad(values[2], top) + off_axis_rad(values[2], bottom), std::fmax(one, other)};
}

}  // namespace alidade
