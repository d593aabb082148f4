#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "alidade/board/board.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Water between a camera and what it looks at; red, green, blue.
struct Water {
  Eigen::Vector3d attenuation_per_m{1.2, 0.5, 0.45};  ///< Of a turbid coast: it takes red first.
  Eigen::Vector3d veil{22.0, 96.0, 104.0};            ///< Grey values of water without end.
};

/// What comes through `distance_m` of water of light `rgb`: rgb e^(−c d) + veil (1 − e^(−c d)), Beer–Lambert with the
/// light that the water itself sends. J. S. Jaffe, "Computer modeling and the design of optimal underwater imaging
/// systems", 1990, without a lamp.
[[nodiscard]] Eigen::Vector3d seen_through(const Water& water, const Eigen::Vector3d& rgb, double distance_m);

struct UnderwaterVideoConfig {
  Water water;
  double blur_px = 1.0;  ///< σ, of optics and of light scattered forward.
  double noise = 4.0;    ///< σ of a colour value's noise, of 255.
};

/// The chessboard of which simulate_underwater()'s points 1 to 8 are corners: 10×8 of 28 mm, frame board = world. The
/// paper's has 9×7 squares; ours has one more all round, so that its outermost vertices are corners as well.
[[nodiscard]] Board underwater_board();

/// What the camera sees of that board on an even grey wall, 8-bit BGR: the print by rays through the lens, blurred,
/// integrated over each pixel; through as much water as lies on each pixel's ray; noise, rounded. `seed` draws the
/// noise.
[[nodiscard]] cv::Mat render_underwater_frame(const Camera& camera, const Rigid3& world_from_cam,
                                              const UnderwaterVideoConfig& config, std::uint64_t seed);

}  // namespace alidade
