#pragma once

#include <cmath>

#include "alidade/observe/frame_buffer.h"

namespace alidade {

/// F test: how much of the residuals of a bundle a separate focal length per frame would explain.
struct FocalVariation {
  double share = 0.0;    ///< Explained share of the squared residuals: 1 is all.
  double f_ratio = 0.0;  ///< Explained per frame over residual per degree of freedom; about 1 by chance.

  /// Whether the focal length varies: constant intrinsics are then not a valid model, however small their σ.
  [[nodiscard]] bool is_significant() const { return share > 0.6 && f_ratio > 8.0; }
};

/// Projects the residuals of each frame with at least two points on ∂px/∂(log f) = px − c.
/// With distortion or a wrong mount the share stays small; with a zoom, only noise remains unexplained.
[[nodiscard]] FocalVariation focal_variation_of(const RotationBundle& bundle, const BundleSolution& solution);

/// F test: how much of the residuals of an adjustment a separate rotation per frame would explain.
struct RotationJitter {
  double f_ratio = 0.0;        ///< Explained per frame over residual per degree of freedom; about 1 by chance.
  double variance_rad2 = 0.0;  ///< Variance of a rotation about an axis across the view, beyond chance.
  double within_frames = 0.0;  ///< σ of a pixel relative to the rotation of its frame, in the units of the adjustment.
  double lasts = 0.0;          ///< Correlation from frame to frame: 0 for noise, larger for model errors.

  static constexpr double more_than_pixels = 3.0;  ///< Limit of f_ratio.

  [[nodiscard]] bool is_noise() const { return lasts < 0.5; }
  /// σ of the noise of the rotations [rad]; 0: no more than the noise of the pixels would appear as.
  [[nodiscard]] double noise_rad() const {
    return f_ratio > more_than_pixels && is_noise() ? std::sqrt(variance_rad2) : 0.0;
  }
};

/// From the mean residual of each frame with at least four points: a small rotation across the view moves all points
/// alike.
[[nodiscard]] RotationJitter rotation_jitter(const Adjustment& reference);

}  // namespace alidade
