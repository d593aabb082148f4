#pragma once

#include <utility>
#include <vector>

#include "alidade/pantilt/head_rotation.h"
#include "alidade/rangefinder/edges.h"
#include "alidade/simulate/rangefinder.h"

// A room for the method of edges: its photo, and the scan of a rangefinder that rotates with the camera.

namespace alidade::reproduce {

/// Rectangles that face the camera before a wall.
struct Box {
  double x0, x1, y0, y1, z, grey;
};
inline const std::vector<Box> boxes{{-1.1, -0.6, -0.5, 0.3, 2.0, 200}, {-0.3, 0.2, -0.7, -0.2, 2.4, 30},
                                    {0.4, 0.9, -0.3, 0.5, 2.2, 220},   {-0.4, 0.1, 0.1, 0.6, 1.8, 160},
                                    {0.3, 0.7, -0.9, -0.5, 2.8, 10},   {-1.2, -0.7, 0.5, 0.9, 2.6, 60}};

/// Distance along the ray, and the grey of what it hits.
[[nodiscard]] inline std::pair<double, double> cast(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  std::pair<double, double> nearest{(4.0 - from.z()) / direction.z(), 110.0};
  for (const Box& box : boxes) {
    const double t = (box.z - from.z()) / direction.z();
    const Eigen::Vector3d hit = from + t * direction;
    const bool is_hit = hit.x() > box.x0 && hit.x() < box.x1 && hit.y() > box.y0 && hit.y() < box.y1;
    if (is_hit && t < nearest.first) nearest = {t, box.grey};
  }
  return nearest;
}

[[nodiscard]] inline Camera edge_camera() {
  Camera camera = rangefinder_scenario("reference")->camera;
  camera.width_px = 320;
  camera.height_px = 240;
  camera.lens = with_params(camera.lens, Eigen::Vector<double, 5>(300.0, 300.0, 159.5, 119.5, 0.0));
  return camera;
}

[[nodiscard]] inline GreyImage photo_of(const Camera& camera) {
  GreyImage photo{320, 240, {}};
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x)
      photo.values.push_back(static_cast<float>(cast(Eigen::Vector3d::Zero(), *unproject(camera, {x, y})).second));
  return photo;
}

[[nodiscard]] inline std::vector<ScanRow> scan_of(const Beam& beam, double step_rad) {
  std::vector<ScanRow> scan;
  for (double tilt = -0.25; tilt <= 0.25; tilt += step_rad)
    for (double pan = -0.4; pan <= 0.4; pan += step_rad) {
      const Eigen::Quaterniond rotation = base_from_cam_rotation({pan, tilt, 0.0});
      scan.push_back({pan, tilt, cast(rotation * beam.origin_in_cam, rotation * beam.direction_in_cam).first});
    }
  return scan;
}

}  // namespace alidade::reproduce
