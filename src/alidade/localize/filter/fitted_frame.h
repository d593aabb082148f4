#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "alidade/localize/filter/feature.h"

// Observations do not depend on the position, rotation and scale of the world. So the posterior along these seven
// directions equals the prior, and that is given by the known points: at its maximum, no similarity transform T of the
// estimate lowers
//     Σ |T(p̂ᵢ) − pᵢ|² / σᵢ²,
// where p̂ᵢ is the estimate of the point given as pᵢ. A linear filter preserves this. A filter that is relinearised in
// every update has second-order errors, and along these directions no observation corrects them: its frame and scale
// drift as long as it runs, without a trace in its covariance. The T that minimises the sum removes this drift. The
// shape of the map, and with it every predicted observation, stays the same.

namespace alidade {

/// x → centre + shift + s G (x − centre); a small transform.
struct FittedFrame {
  Eigen::Vector3d centre, shift;
  Eigen::Matrix3d G;
  double s = 1.0;
  double chi2 = 0.0;  ///< Decrease of the sum above.

  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& place) const {
    return centre + shift + s * (G * (place - centre));
  }
  [[nodiscard]] Feature operator*(const Feature& feature) const;
  /// Derivative of the transformed θ, φ, ρ of an inverse-depth feature with respect to the original ones.
  [[nodiscard]] Eigen::Matrix3d J_angles(const Feature& feature) const;
};

/// One Gauss–Newton step over the known points that were used. Empty if they do not determine it.
[[nodiscard]] std::optional<FittedFrame> fitted_frame(std::span<const Feature> features);

}  // namespace alidade
