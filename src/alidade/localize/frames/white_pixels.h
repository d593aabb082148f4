#pragma once

#include <optional>
#include <span>

#include "alidade/camera/camera.h"
#include "alidade/localize/sequence.h"

namespace alidade {

/// σ of a pixel coordinate by what of points' tracks no smooth motion of a camera explains.
struct WhitePixels {
  double sigma_px = 0.0;
  double relative = 1.0;  ///< σ of it, over it.
  /// Size of what motion leaves in the same differences [px], where much larger a part of it is in `sigma_px`.
  double motion_px = 0.0;
  double tails = 1.0;  ///< Of what is left: its 90 % over that of noise with this σ. Mismatches make it large.
};

/// From third differences of each point's pixels over four frames that follow one another, less what a camera's own
/// third difference leaves in them: six components, as in M. Irani, "Multi-Frame Optical Flow Estimation Using Subspace
/// Constraints", ICCV 1999, with the points' inverse depths, which the motion of some fifty frames tells. So what lasts
/// along a track does nothing: errors of lens, target, map, clocks; and nothing has to be solved before. Median of
/// their sizes, without pixels that leap. Observations with σ of their own are left out. None of too few.
[[nodiscard]] std::optional<WhitePixels> white_pixels(std::span<const ObservationFrame> frames, const Camera& camera);

/// That σ where it clearly is not `usual_px`, noise alone explains what is left, and it is such as finders of points
/// have.
[[nodiscard]] std::optional<double> other_sigma_px(std::span<const ObservationFrame> frames, const Camera& camera,
                                                   double usual_px);

}  // namespace alidade
