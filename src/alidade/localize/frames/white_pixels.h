#pragma once

#include <optional>
#include <span>

#include "alidade/camera/camera.h"
#include "alidade/localize/sequence.h"

namespace alidade {

/// σ of a pixel coordinate, estimated from the part of points' tracks that no smooth camera motion explains.
struct WhitePixels {
  double sigma_px = 0.0;
  double relative = 1.0;  ///< Relative σ of it.
  /// Size of the motion in the same differences [px]; if far larger, part of it leaks into `sigma_px`.
  double motion_px = 0.0;
  double tails = 1.0;  ///< 90 % quantile of residuals over that of noise with this σ. Large: mismatches.
};

/// From third differences of each point's pixels over four consecutive frames, minus the effect of the camera's own
/// third difference: six components, as in M. Irani, "Multi-Frame Optical Flow Estimation Using Subspace Constraints",
/// ICCV 1999, with the points' inverse depths, estimated from the motion of some fifty frames. So persistent errors
/// along a track cancel (lens, target, map, clocks), and no path is needed. Median of their sizes, without outlier
/// pixels. Observations with their own σ are excluded. Empty: too few.
[[nodiscard]] std::optional<WhitePixels> white_pixels(std::span<const ObservationFrame> frames, const Camera& camera);

/// That σ, if it differs significantly from `usual_px`, the residuals look like noise only, and the value is plausible
/// for point detectors.
[[nodiscard]] std::optional<double> other_sigma_px(std::span<const ObservationFrame> frames, const Camera& camera,
                                                   double usual_px);

}  // namespace alidade
