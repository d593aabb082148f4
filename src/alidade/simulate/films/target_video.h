#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "alidade/pantilt/head.h"

namespace cv {
class Mat;
}

namespace alidade {

/// A target in a head's camera: a ball of one colour, or a square card with an image on it.
struct FilmedTarget {
  Eigen::Vector3d rgb{230.0, 70.0, 20.0};  ///< Colour of the ball.
  double radius_m = 0.02;                  ///< Radius of the ball; half the side of the card.
  const cv::Mat* card = nullptr;  ///< 8-bit grey; none: a ball. The card is upright and faces −z of the world.
};

struct TargetVideoConfig {
  double blur_px = 0.6;  ///< σ of the optical blur.
  double noise = 2.0;    ///< σ of the noise of a colour value, of 255.
  double clutter = 0.0;  ///< σ of the colours of patches of one or two degrees behind the target.
};

/// Image of the head's camera, 8-bit BGR: distant static soft grey clouds, and the target with its centre at the given
/// point of the world; none: hidden. Rays through the lens, 3 × 3 per pixel. `seed` determines the noise.
[[nodiscard]] cv::Mat render_target_frame(const RigHead& rig_head, const Eigen::Vector2d& pan_tilt_rad,
                                          const std::optional<Eigen::Vector3d>& target_in_world,
                                          const FilmedTarget& target, const TargetVideoConfig& config,
                                          std::uint64_t seed);

}  // namespace alidade
