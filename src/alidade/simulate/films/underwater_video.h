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

/// Water between a camera and an object; red, green, blue.
struct Water {
  Eigen::Vector3d attenuation_per_m{1.2, 0.5, 0.45};  ///< For a turbid coast: red is absorbed first.
  Eigen::Vector3d veil{22.0, 96.0, 104.0};            ///< Grey values of infinitely deep water.
};

/// Light `rgb` after `distance_m` of water: rgb e^(−c d) + veil (1 − e^(−c d)), Beer–Lambert with the light scattered
/// by the water itself. J. S. Jaffe, "Computer modeling and the design of optimal underwater imaging systems", 1990,
/// without a lamp.
[[nodiscard]] Eigen::Vector3d seen_through(const Water& water, const Eigen::Vector3d& rgb, double distance_m);

struct UnderwaterVideoConfig {
  Water water;
  double blur_px = 1.0;  ///< σ of the blur by optics and forward scattering.
  double noise = 4.0;    ///< σ of the noise of a colour value, of 255.
};

/// The chessboard with simulate_underwater()'s points 1 to 8 as corners: 10×8 of 28 mm, frame board = world. The
/// paper's has 9×7 squares; here there is one more all round, so that its outermost vertices are corners as well.
[[nodiscard]] Board underwater_board();

/// Image of that board on a uniform grey wall, 8-bit BGR: the print by rays through the lens, blurred and integrated
/// over each pixel; attenuated by the water along each pixel's ray; with noise, rounded. `seed` determines the
/// noise.
[[nodiscard]] cv::Mat render_underwater_frame(const Camera& camera, const Rigid3& world_from_cam,
                                              const UnderwaterVideoConfig& config, std::uint64_t seed);

}  // namespace alidade
