#pragma once

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/observe/frame_buffer.h"

namespace alidade {

/// Covariance of an adjustment whose residuals share errors, in time (blur, a late clock, noise of the angles) and
/// along the track of a point, and what tells it from the model's.
struct StatedCovariance {
  CommonMatrix cov;           ///< Of the common parameters, normalised; nowhere below the model's.
  Eigen::VectorXd inflation;  ///< σ over the model's.
  ClusterCovariance blocks;   ///< Blocks of time.
  double correlation_s = 0.0, block_s = 0.0;
  double track_effect = 1.0;  ///< Variance of the tracks' scores over that of their parts, track × block.
  bool counts_tracks = false;
};

/// Two-way cluster-robust covariance: Σ_time + Σ_track − Σ_both, made positive. Blocks of time are as long as five
/// times the residuals' correlation where at least six fit; where not, what the correlation across their borders hides
/// is added. Tracks count where their scatter is beyond chance (three of its σ): a few of them say little. Not for
/// bundles with turns: the model's covariance comes back. Cameron, Gelbach & Miller, J. Bus. Econ. Stat. 29(2), 2011.
[[nodiscard]] StatedCovariance stated_covariance(const Adjustment& reference, const ObserveNuisances& nuisances);

/// τ of what lasts in the residuals along the tracks, for a correlation c exp(−t/τ): c is the share of the noise that
/// lasts, the rest is white. From the mean lag of their correlation, freed of what the points' bearings take of it.
/// 0: white noise.
[[nodiscard]] double residual_correlation_s(const Adjustment& reference);

/// Share of a sum's variance that is seen within blocks of length `block_s`, for a correlation exp(−t/τ).
[[nodiscard]] double seen_within(double block_s, double correlation_s);

/// A residual's weight, normalised: Huber's over σ².
[[nodiscard]] double residual_weight(const Adjustment& reference, std::size_t observation);

}  // namespace alidade
