#pragma once

#include "alidade/observe/frame_buffer.h"

namespace alidade {

/// How much of a bundle's residuals a focal length of its own for each frame would explain.
struct Steadiness {
  double share = 0.0;    ///< Of the squared residuals: 1 is all.
  double f_ratio = 0.0;  ///< Explained a frame, over what is left a degree of freedom: 1 by chance.

  /// The focal length does not stand still: one set of intrinsics is no answer, however small its σ.
  [[nodiscard]] bool is_unsteady() const { return share > 0.6 && f_ratio > 8.0; }
};

/// The residual of a frame along ∂px/∂(log f) = px − c, for each frame that sees two points or more.
/// Distortion or a wrong mount explain less by a common scale than they leave; a zoom leaves noise.
[[nodiscard]] Steadiness steadiness_of(const RotationBundle& bundle, const BundleSolution& solution);

/// How much of an adjustment's residuals a rotation of its own for each frame would explain.
struct TurnJitter {
  double f_ratio = 0.0;        ///< Explained a frame, over what is left a degree of freedom: 1 by chance.
  double variance_rad2 = 0.0;  ///< Of a rotation about an axis across the view, beyond chance.
  double lasts = 0.0;          ///< Correlation from frame to frame: noise has none, what is not modelled has.

  [[nodiscard]] bool is_noise() const { return lasts < 0.5; }
};

/// From the mean residual of each frame that sees four points or more: a small rotation across the view moves all
/// alike.
[[nodiscard]] TurnJitter turn_jitter(const Adjustment& reference);

}  // namespace alidade
