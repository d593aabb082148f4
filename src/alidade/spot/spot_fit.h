#pragma once

#include "alidade/spot/spot_candidates.h"
#include "alidade/spot/spot_signal.h"

namespace alidade {

/// Subpixel position of a spot, in pixels of the signal's part.
struct SpotPlace {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d cov = Eigen::Matrix2d::Identity();  ///< [px²]
  double radius_px = 0.0;
  double peak = 0.0;
  double offset_light = 0.0;  ///< Light around the spot that does not belong to it.
  bool is_saturated = false;
  bool is_on_edge = false;
  std::string reason;
};

/// Speckle contrast of laser light (σ over mean) from `num` squares relative to those of the light, `excess` their sum;
/// with a prior, because a laser always speckles, by how much few pixels do not show.
[[nodiscard]] double speckle_contrast(double excess, double num);

/// Centroid of the light in a disc of three sigmas around itself, iterated until convergence. If ink and paper share
/// the disc, it is the initial guess of fit_on_edge().
[[nodiscard]] SpotPlace measure_spot(const SpotSignal& signal, const SpotCandidate& candidate);

/// Fits the light of a Gaussian spot on a print whose ink has r times the reflectance of paper,
///     S(p) = s · exp(−½ (p−μ)ᵀ Σ⁻¹ (p−μ)) · (r + (1 − r) w(p)),
/// with w the fraction of paper. Blur acts on the product: it widens the spot from Σ' to Σ = Σ' + b² and shifts the
/// point of the print seen at p to μ + Σ' Σ⁻¹ (p − μ), where the print is blurred by less than b (product of two
/// Gaussians). Saturated pixels only provide a lower bound of the light.
[[nodiscard]] SpotPlace fit_on_edge(const SpotSignal& signal, const SpotPlace& start);

}  // namespace alidade
