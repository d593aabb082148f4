#pragma once

#include "alidade/turned/turned_fit.h"

namespace alidade {

/// Covariance of a fit whose errors are shared within photos (the hand moved, the shutter rolls, the focus walks).
/// Normalised.
struct ScatterCovariance {
  TurnedInformation cov, cov_model;
  double design_effect = 1.0;  ///< Of photos: the scatter over what the model expects of it.
  double degrees_of_freedom = 0.0;
  std::vector<double> z2;  ///< One per photo: |δ|² over what the model expects of it, in V's units.
};

/// The change from omitting each photo, δ_k (one step from the optimum), relative to its expectation by the model,
/// Cov δ_k = V₋ₖ − V (Hausman, Econometrica 46, 1978): the sum of δδᵀ − (V₋ₖ − V), where it is above zero, is added to
/// V. Errors of a photo affect all its matches, so that matches are not clusters (Snijders & Borgatti,
/// Connections 22, 1999: the jackknife over nodes). With few photos the scatter by direction is shrunk towards one
/// ratio for all, and widened by ν/(ν − 2). docs/maths/turned-photos.md.
[[nodiscard]] ScatterCovariance scatter_covariance(const TurnedFit& fit, const Progress& progress = {});

/// As unlikely as 3 σ are, in the σ of a term of the camera: the part that a few photos' scatter told has Student's
/// tails (Abramowitz & Stegun 26.7.5), ν by Satterthwaite.
[[nodiscard]] double three_sigma_of(int term, const ScatterCovariance& scatter);

/// Within that of zero.
[[nodiscard]] bool is_nearly_zero(int term, const TurnedFit& fit, const ScatterCovariance& scatter);

}  // namespace alidade
