#pragma once

#include <Eigen/Core>
#include <limits>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// What an estimator detected in a frame.
enum class ObserveEvent {
  none,
  start,        ///< The first estimate.
  burst,        ///< An outlier frame was rejected.
  slip,         ///< An outlier point was rejected; see `point`.
  zoom,         ///< The intrinsics are changing.
  zoom_end,     ///< They are constant again.
  restart,      ///< Reinitialised from the last seconds.
  new_segment,  ///< A gap: the rotation across it is not known.
};

/// Intrinsics of a rotating camera after a frame, for every method. [px]
struct IntrinsicsEstimate {
  bool has_value = false;  ///< False: no estimate yet; the values below are invalid.
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
  double k1 = 0.0;
  Eigen::Vector4d sigma = Eigen::Vector4d::Zero();        ///< σ of fx, fy, cx, cy; NaN if the method has none.
  double nis = std::numeric_limits<double>::quiet_NaN();  ///< Normalised innovation squared of this frame.
  int nis_dof = 0;
  ObserveEvent event = ObserveEvent::none;
  int point = -1;  ///< The outlier point for slip, counted from 0.

  [[nodiscard]] Eigen::Vector4d values() const { return {fx, fy, cx, cy}; }
};

/// Normalisation of pixels: q = (px − centre) / scale. All equations keep their form, and the condition number falls
/// from 7·10⁷ to 3·10². Hartley & Zisserman, 2003, §4.4.
struct PixelScale {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< Centre of the image. [px]
  double scale = 1.0;                                ///< About half its width. [px]

  [[nodiscard]] Eigen::Vector2d normalised(const Eigen::Vector2d& px) const { return (px - centre) / scale; }
  /// Normalises fx, fy, cx, cy [px].
  [[nodiscard]] Eigen::Vector4d normalised_intrinsics(const Eigen::Vector4d& k_px) const {
    const Eigen::Vector2d c = normalised(k_px.tail<2>());
    return {k_px[0] / scale, k_px[1] / scale, c.x(), c.y()};
  }
  /// The inverse: fx, fy, cx, cy [px].
  [[nodiscard]] Eigen::Vector4d intrinsics_px(const Eigen::Vector4d& k) const {
    return {scale * k[0], scale * k[1], scale * k[2] + centre.x(), scale * k[3] + centre.y()};
  }
};

ALIDADE_PUBLIC_END
}  // namespace alidade
