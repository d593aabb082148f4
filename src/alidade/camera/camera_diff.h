#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "alidade/camera/projection_sigma.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

struct CameraDiffConfig {
  int cols = 60;
  int rows = 40;
  /// Where the cameras look: infinity takes a rotation out of the difference, a distance a rotation and a translation.
  double distance_m = std::numeric_limits<double>::infinity();
};

/// One parameter of two lenses of the same model; σ is NaN where a camera has no covariance.
struct ParameterDiff {
  std::string name;
  double a = 0.0, b = 0.0, sigma_a = 0.0, sigma_b = 0.0;
};

/// How far apart two cameras are over the image, after the motion between their frames that fits best.
struct CameraDiff {
  PixelGrid delta_u, delta_v;  ///< Where b sees what a sees at the pixel, minus the pixel; NaN where not both see.
  PixelGrid sigma_a, sigma_b;  ///< Each camera's own projection_sigma(); all NaN without a covariance.
  /// sqrt(δᵀ C⁻¹ δ / 2), C the covariance of the difference by what is known of a and b: about 1 if the two are the
  /// same camera, calibrated apart. All NaN where neither covariance is known.
  PixelGrid in_sigmas;
  Rigid3 b_from_a;
  std::size_t num_compared = 0;  ///< Grid pixels that both see.
  double rms_px = 0.0, max_px = 0.0;
  double central_rms_px = 0.0;  ///< Within a third of half the smaller side around the centre; NaN if nothing is there.
  double rms_in_sigmas = 0.0, max_in_sigmas = 0.0;  ///< NaN where no covariance is known.
  std::vector<ParameterDiff> parameters;            ///< Empty where the models differ.
};

/// Compares what two cameras of one image size see. The models may differ. The motion is fitted by Gauss–Newton with
/// weights 1/σ² where σ is known, and robust ones, so that corners where a model fails do not rotate the image.
/// None where the sizes differ or fewer than ten pixels of the grid are seen by both.
/// D. Kogan, mrcal, "Differencing"; docs/maths/camera-models.md.
[[nodiscard]] std::optional<CameraDiff> diff_cameras(const Camera& a, const Camera& b,
                                                     const CameraDiffConfig& config = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
