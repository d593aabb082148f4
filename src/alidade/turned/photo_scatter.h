#pragma once

#include "alidade/turned/turned_fit.h"

namespace alidade {

/// Covariance of a fit whose errors are shared within photos (hand motion, rolling shutter, changes of focus).
/// Normalised.
struct ScatterCovariance {
  TurnedInformation cov, cov_model;
  double design_effect = 1.0;  ///< Scatter of the photos over its expectation by the model.
  double degrees_of_freedom = 0.0;
  std::vector<double> z2;  ///< One per photo: |δ|² over its expectation by the model, in units of V.
};

/// The change from omitting each photo, δ_k (one step from the optimum), relative to its expectation by the model,
/// Cov δ_k = V₋ₖ − V (Hausman, Econometrica 46, 1978): the sum of δδᵀ − (V₋ₖ − V), where it is above zero, is added to
/// V. Errors of a photo affect all its matches, so that matches are not clusters (Snijders & Borgatti,
/// Connections 22, 1999: the jackknife over nodes). With few photos the scatter by direction is shrunk towards one
/// ratio for all, and widened by ν/(ν − 2). docs/maths/turned-photos.md.
[[nodiscard]] ScatterCovariance scatter_covariance(const TurnedFit& fit, const Progress& progress = {});

/// The deviation, in σ of a camera term, that is as unlikely as 3 σ: the part of σ due to the scatter of a few photos
/// has the tails of Student's distribution (Abramowitz & Stegun 26.7.5), ν by Satterthwaite.
[[nodiscard]] double three_sigma_of(int term, const ScatterCovariance& scatter);

/// Whether a term is within that deviation of zero.
[[nodiscard]] bool is_nearly_zero(int term, const TurnedFit& fit, const ScatterCovariance& scatter);

}  // namespace alidade
