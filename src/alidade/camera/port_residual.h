#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

struct PortResidualConfig {
  std::vector<double> fit_ranges_m{0.75, 1.0, 1.5};  ///< Where a calibration in water would hold its boards.
  std::vector<double> test_ranges_m{0.3, 0.5, 1.0, 3.0};
  int cols = 25, rows = 19;  ///< Pixels of the image that are compared.
};

/// What a Brown lens leaves of a flat port at one range.
struct PortRange {
  double range_m = 0.0;  ///< Depth over the lens' centre, along its axis.
  double rms_px = 0.0, max_px = 0.0;
};

/// How well one Brown lens with one viewpoint approximates a camera behind a flat port.
struct PortResidual {
  Camera brown;               ///< As a calibration in water would find it.
  Eigen::Vector3d shift_m;    ///< Its viewpoint in the camera frame: belongs to the extrinsics.
  std::vector<PortRange> at;  ///< One per test range.
  double worst_rms_px = 0.0;  ///< Over the test ranges from 0.5 m on.
  bool brown_is_enough = false;
};

/// Above this RMS [px] from 0.5 m on, the port's own model is worth its trouble: noise of a good corner is a third.
inline constexpr double port_residual_limit_px = 0.3;

/// Least-squares Brown lens (skew fixed) with a free constant viewpoint, of what `port` sees over the image at the
/// fit's ranges, and what remains at others. None where the lens is no flat port, or nothing can be fitted.
/// docs/maths/camera-models.md; T. Treibitz et al., "Flat refractive geometry", PAMI 34(1), 2012, for why it remains.
[[nodiscard]] std::optional<PortResidual> port_residual(const Camera& port, const PortResidualConfig& config = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
