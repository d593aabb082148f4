#pragma once

#include <cmath>

#include "alidade/observe/frame_buffer.h"

namespace alidade {

/// F test: how much of a bundle's residuals a separate focal length for each frame would explain.
struct FocalVariation {
  double share = 0.0;    ///< Of the squared residuals: 1 is all.
  double f_ratio = 0.0;  ///< Explained per frame over residual per degree of freedom: 1 by chance.

  /// The focal length varies: constant intrinsics are not a valid model, however small their σ.
  [[nodiscard]] bool is_significant() const { return share > 0.6 && f_ratio > 8.0; }
};

/// The residual of a frame along ∂px/∂(log f) = px − c, for each frame that sees two points or more.
/// With distortion or a wrong mount the share stays small; with a zoom only noise remains.
[[nodiscard]] FocalVariation focal_variation_of(const RotationBundle& bundle, const BundleSolution& solution);

/// F test: how much of an adjustment's residuals a separate rotation for each frame would explain.
struct RotationJitter {
  double f_ratio = 0.0;        ///< Explained per frame over residual per degree of freedom: 1 by chance.
  double variance_rad2 = 0.0;  ///< Of a rotation about an axis across the view, beyond chance.
  double within_frames = 0.0;  ///< σ of a pixel about its frame's own rotation, in units of the adjustment.
  double lasts = 0.0;          ///< Correlation from frame to frame: 0 for noise, larger for model errors.

  static constexpr double more_than_pixels = 3.0;  ///< Of f_ratio.

  [[nodiscard]] bool is_noise() const { return lasts < 0.5; }
  /// σ of the rotations' noise; 0: no more than the pixels' own would be taken for.
  [[nodiscard]] double noise_rad() const {
    return f_ratio > more_than_pixels && is_noise() ? std::sqrt(variance_rad2) : 0.0;
  }
};

/// From the mean residual of each frame that sees four points or more: a small rotation across the view moves all
/// alike.
[[nodiscard]] RotationJitter rotation_jitter(const Adjustment& reference);

}  // namespace alidade
