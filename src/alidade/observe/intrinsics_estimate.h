#pragma once

#include <Eigen/Core>
#include <limits>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// What an estimator noticed in a frame.
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

/// Intrinsics of a rotating camera after a frame, by whatever method. [px]
struct IntrinsicsEstimate {
  bool has_value = false;  ///< False: not yet; nothing below holds.
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
  double k1 = 0.0;
  Eigen::Vector4d sigma = Eigen::Vector4d::Zero();        ///< Of fx, fy, cx, cy; NaN where the method has none.
  double nis = std::numeric_limits<double>::quiet_NaN();  ///< Normalised innovation squared of this frame.
  int nis_dof = 0;
  ObserveEvent event = ObserveEvent::none;
  int point = -1;  ///< Of a slip, from 0.

  [[nodiscard]] Eigen::Vector4d values() const { return {fx, fy, cx, cy}; }
};

/// Normalisation of pixels: q = (px − centre) / scale, so that every equation keeps its form and the condition number
/// falls from 7·10⁷ to 3·10². Hartley & Zisserman, 2003, §4.4.
struct PixelScale {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< Centre of the image. [px]
  double scale = 1.0;                                ///< About half its width. [px]

  [[nodiscard]] Eigen::Vector2d normalised(const Eigen::Vector2d& px) const { return (px - centre) / scale; }
  /// Of fx, fy, cx, cy.
  [[nodiscard]] Eigen::Vector4d normalised_intrinsics(const Eigen::Vector4d& k_px) const {
    const Eigen::Vector2d c = normalised(k_px.tail<2>());
    return {k_px[0] / scale, k_px[1] / scale, c.x(), c.y()};
  }
  /// And back.
  [[nodiscard]] Eigen::Vector4d intrinsics_px(const Eigen::Vector4d& k) const {
    return {scale * k[0], scale * k[1], scale * k[2] + centre.x(), scale * k[3] + centre.y()};
  }
};

ALIDADE_PUBLIC_END
}  // namespace alidade
