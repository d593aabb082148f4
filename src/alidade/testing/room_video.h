#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/simulate/draws.h"

namespace alidade::testing {

/// A world for `localize` with images: a camera is moved by hand in front of a table and a wall, on which a dark
/// rectangle on white paper hangs. The world's frame is at the rectangle's centre, x right, y down.
struct RoomScene {
  Camera camera;  ///< See room_camera().
  double rectangle_width_m = 0.210, rectangle_height_m = 0.1485;
  bool has_rectangle = true;
  bool has_texture = true;  ///< False: walls of one grey.
  int num_frames = 90;
  double rate_hz = 30.0;
  double noise = 2.0;      ///< σ of the grey values.
  double amplitude = 1.0;  ///< Of the path: 1 is ± 0.12 m aside and ± 7°.
  long num_columns = 0;    ///< Of squares, after which wall and table look the same again, as wallpaper; 0: never.
};

/// A grey value of a cell of a surface, the same at every call.
inline double cell_grey(long i, long j, long surface) {
  std::uint64_t h = static_cast<std::uint64_t>(i * 73856093L ^ j * 19349663L ^ surface * 83492791L);
  h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9ULL;
  h = (h ^ (h >> 27)) * 0x94d049bb133111ebULL;
  return 40.0 + 180.0 * static_cast<double>((h ^ (h >> 31)) >> 11) * 0x1p-53;
}

/// Squares of different greys with edges about a pixel wide, so that pixels need not be averaged.
inline double squares_grey(double s_m, double t_m, long surface, long num_columns = 0) {
  constexpr double cell_m = 0.045, edge_m = 0.008;
  const auto ramp = [](double within) { return std::clamp((within - 0.5) * cell_m / edge_m + 0.5, 0.0, 1.0); };
  const double along = s_m / cell_m, t = t_m / cell_m, n = static_cast<double>(num_columns);
  const double s = num_columns > 0 ? along - n * std::floor(along / n) : along;
  const auto i = static_cast<long>(std::floor(s)), j = static_cast<long>(std::floor(t));
  const long next = i + 1 == num_columns ? 0 : i + 1;
  const double a = ramp(s - static_cast<double>(i)), b = ramp(t - static_cast<double>(j));
  return (1 - b) * ((1 - a) * cell_grey(i, j, surface) + a * cell_grey(next, j, surface)) +
         b * ((1 - a) * cell_grey(i, j + 1, surface) + a * cell_grey(next, j + 1, surface));
}

/// 1 inside a rectangle of half sides x and y, 0 outside, with an edge of finite width.
inline double inside(double s_m, double t_m, double half_s_m, double half_t_m) {
  constexpr double edge_m = 0.005;
  const double depth_m = std::min(half_s_m - std::abs(s_m), half_t_m - std::abs(t_m));
  return std::clamp(depth_m / edge_m + 0.5, 0.0, 1.0);
}

/// Grey of what a ray meets first: the wall with paper and rectangle, a box in front of it, the table.
inline double grey_of(const RoomScene& scene, const Eigen::Vector3d& from, const Eigen::Vector3d& ray) {
  double nearest = std::numeric_limits<double>::infinity(), grey = 128.0;
  const auto meet = [&](double distance, const auto& grey_at) {
    if (!(distance > 0.0) || distance >= nearest) return;
    const std::optional<double> value = grey_at(from + distance * ray);
    if (!value) return;
    nearest = distance;
    grey = *value;
  };
  const auto squares = [&](double s, double t, long surface) {
    return scene.has_texture ? squares_grey(s, t, surface, scene.num_columns) : 128.0;
  };
  constexpr double table_m = 0.30, box_z_m = -0.12, box_x_m = 0.28, back_m = 0.5;
  meet(-from.z() / ray.z(), [&](const Eigen::Vector3d& p) -> std::optional<double> {
    if (!scene.has_rectangle) return std::nullopt;
    const double paper =
        inside(p.x(), p.y(), 0.5 * scene.rectangle_width_m + 0.04, 0.5 * scene.rectangle_height_m + 0.04);
    if (!(paper > 0.5)) return std::nullopt;
    const double dark = inside(p.x(), p.y(), 0.5 * scene.rectangle_width_m, 0.5 * scene.rectangle_height_m);
    return 215.0 - 185.0 * dark;
  });
  meet((back_m - from.z()) / ray.z(),
       [&](const Eigen::Vector3d& p) -> std::optional<double> { return squares(p.x(), p.y(), 1); });
  meet((table_m - from.y()) / ray.y(),
       [&](const Eigen::Vector3d& p) -> std::optional<double> { return squares(p.x(), p.z(), 2); });
  meet((box_z_m - from.z()) / ray.z(), [&](const Eigen::Vector3d& p) -> std::optional<double> {
    if (std::abs(p.x() - box_x_m) > 0.09 || std::abs(p.y() - 0.1) > 0.2) return std::nullopt;
    return squares(p.x(), p.y(), 3);
  });
  return grey;
}

/// 320×240, equidistant, 195 px: a wide lens.
[[nodiscard]] inline Camera room_camera() {
  Camera camera;
  camera.width_px = 320;
  camera.height_px = 240;
  Params<KannalaBrandt> values = Params<KannalaBrandt>::Zero();
  values.head<4>() << 195.0, 195.0, 159.5, 119.5;
  camera.lens = Calibrated<KannalaBrandt>{values};
  return camera;
}

/// Poses at the times of the frames.
[[nodiscard]] inline std::vector<Rigid3> room_path(const RoomScene& scene) {
  std::vector<Rigid3> path;
  for (int i = 0; i < scene.num_frames; ++i) {
    const double t = i / scene.rate_hz, a = scene.amplitude;
    const Eigen::Vector3d position(0.12 * a * std::sin(1.9 * t), 0.08 * a * std::sin(1.3 * t + 0.4) - 0.03,
                                   -0.70 + 0.08 * a * std::sin(1.1 * t));
    const Eigen::Vector3d turn(0.06 * a * std::sin(1.2 * t), 0.12 * a * std::sin(1.6 * t + 0.3),
                               0.05 * a * std::sin(0.9 * t));
    path.push_back({exp_so3(turn), position});
  }
  return path;
}

/// Of each pixel, row by row. Those of the last camera are kept: all images of a film have the same.
[[nodiscard]] inline const std::vector<std::optional<Eigen::Vector3d>>& room_rays(const Camera& camera) {
  static Camera last;
  static std::vector<std::optional<Eigen::Vector3d>> rays;
  const bool is_last = camera.width_px == last.width_px && camera.height_px == last.height_px &&
                       model_name(camera.lens) == model_name(last.lens) && params(camera.lens) == params(last.lens);
  if (is_last && !rays.empty()) return rays;
  std::vector<Eigen::Vector2d> pixels;
  for (int v = 0; v < camera.height_px; ++v)
    for (int u = 0; u < camera.width_px; ++u) pixels.emplace_back(u, v);
  rays = unproject(camera, pixels);
  last = camera;
  return rays;
}

/// A frame, 8-bit grey: rays cast on the planes of the room, with noise drawn by `seed`.
[[nodiscard]] inline cv::Mat render_room(const RoomScene& scene, const Rigid3& world_from_cam, std::uint64_t seed) {
  const int width = scene.camera.width_px, height = scene.camera.height_px;
  cv::Mat image(height, width, CV_8U);
  Draws draws(seed);
  auto ray_in_cam = room_rays(scene.camera).begin();
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u, ++ray_in_cam) {
      const double grey =
          *ray_in_cam ? grey_of(scene, world_from_cam.translation, world_from_cam.rotation * **ray_in_cam) : 0.0;
      image.at<std::uint8_t>(v, u) = cv::saturate_cast<std::uint8_t>(grey + scene.noise * draws.normal());
    }
  }
  return image;
}

}  // namespace alidade::testing
