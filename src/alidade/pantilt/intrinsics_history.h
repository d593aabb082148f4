#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/public.h"

// A lens that zooms: intrinsics as a function of time, estimated by an observer, or true.

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Intrinsics of a camera at one instant: fx, fy, cx, cy, with the σ of each. [px]
struct IntrinsicsSample {
  Eigen::Vector4d k = Eigen::Vector4d::Zero();
  Eigen::Vector4d sigma = Eigen::Vector4d::Zero();
};

/// The intrinsics of a camera file with their σ; zero σ without a covariance.
[[nodiscard]] IntrinsicsSample own_lens(const Camera& camera);

/// Maps pixels from a camera's own intrinsics to others, keeping skew and distortion: c + (f / f_own) (px_own − c_own).
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

/// Intrinsics of a head's camera over time, as estimated by `alidade observe`.
struct IntrinsicsHistory {
  std::string name;                    ///< File name, for messages.
  std::vector<double> t_s;             ///< Ascending.
  std::vector<IntrinsicsSample> lens;  ///< One per time; empty where the camera's own intrinsics are used.
  double from_s = 0.0, until_s = 0.0;  ///< Time span of the observer's log.

  /// Linear interpolation between the times, constant before the first and after the last.
  [[nodiscard]] IntrinsicsSample at(double at_s) const;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
