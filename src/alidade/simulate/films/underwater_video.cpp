#include "alidade/simulate/films/underwater_video.h"

#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "alidade/simulate/boards/board_light.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

/// How far it is along each pixel's ray to the plane of the board.
class WallDistance {
 public:
  WallDistance(const Camera& camera, const Rigid3& world_from_cam)
      : rays_(camera, 0, camera.width_px, 0, camera.height_px),
        z_in_cam_(world_from_cam.rotation.conjugate() * Eigen::Vector3d::UnitZ()),
        cam_z_in_world_(world_from_cam.translation.z()) {}

  /// Infinite where a ray never gets there. [m]
  [[nodiscard]] double operator()(int u, int v) const {
    const double from_z = cam_z_in_world_ + z_in_cam_.dot(rays_.origin(u, v));
    const double distance_m = -from_z / z_in_cam_.dot(rays_.ray(u, v));
    return distance_m > 0.0 ? distance_m : std::numeric_limits<double>::infinity();
  }

 private:
  RayTable rays_;
  Eigen::Vector3d z_in_cam_;  ///< The wall's normal.
  double cam_z_in_world_;
};

}  // namespace

Eigen::Vector3d seen_through(const Water& water, const Eigen::Vector3d& rgb, double distance_m) {
  const Eigen::Array3d comes = (-distance_m * water.attenuation_per_m.array()).exp();
  return comes * rgb.array() + (1.0 - comes) * water.veil.array();
}

Board underwater_board() { return {BoardKind::chessboard, 10, 8, 0.028}; }

cv::Mat render_underwater_frame(const Camera& camera, const Rigid3& world_from_cam, const UnderwaterVideoConfig& config,
                                std::uint64_t seed) {
  BoardScene scene{camera, underwater_board(), points_in_board(underwater_board()), {world_from_cam.inverse()}};
  RenderConfig render;
  render.blur_px = config.blur_px;
  render.background_texture = 0.0;
  render.oversampling = 2;  // enough under such a blur: corners come out as with 4
  // Water is put before the blurred image: over a blur's width it changes by a thousandth.
  const PixelLight light = BoardLight(scene, 0, render, seed).ambient();
  const WallDistance distance_m(camera, world_from_cam);
  Draws draws(seed);
  cv::Mat frame(camera.height_px, camera.width_px, CV_8UC3);
  for (int v = 0; v < frame.rows; ++v) {
    auto* row = frame.ptr<cv::Vec3b>(v);
    for (int u = 0; u < frame.cols; ++u) {
      const Eigen::Vector3d grey = Eigen::Vector3d::Constant(static_cast<double>(light(v, u)));
      const Eigen::Vector3d rgb = seen_through(config.water, grey, distance_m(u, v));
      for (int channel = 0; channel < 3; ++channel)
        row[u][channel] = cv::saturate_cast<unsigned char>(rgb[2 - channel] + config.noise * draws.normal());
    }
  }
  return frame;
}

}  // namespace alidade
