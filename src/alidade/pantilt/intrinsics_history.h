#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/public.h"

// A lens that zooms: intrinsics as a function of time, estimated by an observer, or true.

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Intrinsics of a camera at one instant: fx, fy, cx, cy, and σ of each. [px]
struct IntrinsicsSample {
  Eigen::Vector4d k = Eigen::Vector4d::Zero();
  Eigen::Vector4d sigma = Eigen::Vector4d::Zero();
};

/// The intrinsics of a camera file, with its σ; without a covariance zero.
[[nodiscard]] IntrinsicsSample own_lens(const Camera& camera);

/// From a camera's own intrinsics to others, its skew and distortion about them: px = c + (f / f_own) (px_own − c_own).
struct Zoomed {
  Zoomed(const Camera& camera, const Eigen::Vector4d& k);

  Eigen::Vector2d centre, own_centre, ratio;

  [[nodiscard]] Eigen::Vector2d px(const Eigen::Vector2d& own_px) const {
    return centre + ratio.cwiseProduct(own_px - own_centre);
  }
  [[nodiscard]] Eigen::Vector2d own_px(const Eigen::Vector2d& px) const {
    return own_centre + (px - centre).cwiseQuotient(ratio);
  }
};

/// Intrinsics over time, as `alidade observe` estimates them of a head's camera.
struct IntrinsicsHistory {
  std::string name;                    ///< Of the file, for messages.
  std::vector<double> t_s;             ///< Ascending.
  std::vector<IntrinsicsSample> lens;  ///< One per time; none where the camera's own intrinsics are used.
  double from_s = 0.0, until_s = 0.0;  ///< What the observer's log spans.

  /// Linear between the times, constant before the first and after the last.
  [[nodiscard]] IntrinsicsSample at(double at_s) const;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
