#pragma once

#include <cstdint>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace cv {
class Mat;
}

namespace alidade {

/// A world for `localize` with pictures: a camera is moved by hand in front of a table and a wall, on which a dark
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
};

/// 320×240, equidistant, 195 px: a wide lens.
[[nodiscard]] Camera room_camera();

/// Poses at the times of the frames.
[[nodiscard]] std::vector<Rigid3> room_path(const RoomScene& scene);

/// A frame, 8-bit grey: rays cast on the planes of the room, with noise drawn by `seed`.
[[nodiscard]] cv::Mat render_room(const RoomScene& scene, const Rigid3& world_from_cam, std::uint64_t seed);

}  // namespace alidade
