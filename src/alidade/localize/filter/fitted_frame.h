#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "alidade/localize/filter/feature.h"

// No observation depends on where the world is, how it is rotated or how large it is. So the posterior along these
// seven directions is the prior's, and that is the known points': at its maximum no similarity T of the estimate
// lessens
//     Σ |T(p̂ᵢ) − pᵢ|² / σᵢ²,
// the p̂ᵢ the estimates of the points that were given as pᵢ. A linear filter keeps that for ever. One that is linearised
// anew in every update errs by its second order, and what it errs by along these directions nothing seen corrects: its
// frame and its scale drift as long as it runs, and its covariance says nothing of it. This T takes it back. The shape
// of the map, and with it everything that is expected of an observation, stays as it is.

namespace alidade {

/// x → centre + shift + s G (x − centre), of small size.
struct FittedFrame {
  Eigen::Vector3d centre, shift;
  Eigen::Matrix3d G;
  double s = 1.0;
  double chi2 = 0.0;  ///< By how much it lessens the sum above.

  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& place) const {
    return centre + shift + s * (G * (place - centre));
  }
  [[nodiscard]] Feature operator*(const Feature& feature) const;
  /// Derivative of θ, φ, ρ of an inverse depth, transformed, by what they were.
  [[nodiscard]] Eigen::Matrix3d J_angles(const Feature& feature) const;
};

/// One Gauss–Newton step: of the known points that were used. None where they do not determine it.
[[nodiscard]] std::optional<FittedFrame> fitted_frame(std::span<const Feature> features);

}  // namespace alidade
