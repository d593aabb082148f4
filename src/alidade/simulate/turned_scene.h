#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "alidade/matching/matched_photos.h"

namespace alidade {

/// A camera that takes photos while rotated by hand, and the matches between them.
struct TurnedScene {
  int width_px = 1280, height_px = 960;
  double fx = 1000.0, fy = 1000.0, cx = 645.0, cy = 474.0;  ///< [px]
  double k1 = 0.0, k2 = 0.0, p1 = 0.0, p2 = 0.0, k3 = 0.0;
  int num_photos = 9;
  double pan_step_rad = 0.3, tilt_rad = 0.15;  ///< Between photos; tilt alternately up and down.
  double shake_rad = 0.03;                     ///< σ of every angle, including roll.
  double points_per_rad2 = 600.0;
  double min_depth_m = 2.0, max_depth_m = 20.0;
  Eigen::Vector3d lever_m = Eigen::Vector3d::Zero();  ///< Camera centre from the centre of rotation, camera frame.
  double sigma_step_m = 0.0;                          ///< σ of the centre's own steps, per axis (hand motion).
  double sigma_px = 0.5;
  double found_share = 0.6;   ///< Share of a point's appearances in two photos that are matched.
  double wrong_share = 0.0;   ///< Share of the matches with a random point of the second photo.
  double moving_share = 0.0;  ///< Share of points that each photo sees elsewhere, within a degree or so.
  std::vector<double> zoom;   ///< Focal length of each photo over f; missing: 1.
};

/// Points over the whole sphere in these photos, and matches for every pair with ten or more common points.
[[nodiscard]] MatchedPhotos simulate_turned_photos(const TurnedScene& scene, std::uint64_t seed);

/// cam_from_world of its photos. World: the first photo's frame except for tilt and shake, x right, y down, z forward.
[[nodiscard]] std::vector<Eigen::Quaterniond> turned_attitudes(const TurnedScene& scene, std::uint64_t seed);

}  // namespace alidade
