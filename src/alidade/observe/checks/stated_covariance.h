#pragma once

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/observe/frame_buffer.h"

namespace alidade {

/// Covariance of an adjustment whose residuals share errors, in time (blur, a late clock, noise of the angles) and
/// along the track of a point, and why it differs from the model's.
struct StatedCovariance {
  CommonMatrix cov;           ///< Of the shared parameters, normalised; nowhere below the model's.
  CommonMatrix lasting;       ///< What it would be if errors of a track last as they were seen to, and nothing else.
  Eigen::VectorXd inflation;  ///< σ over the model's.
  ClusterCovariance blocks;   ///< Blocks of time.
  double correlation_s = 0.0, block_s = 0.0;
  double track_effect = 1.0;  ///< Variance of the tracks' scores over what lasts in them.
  bool counts_tracks = false;
};

/// Cluster-robust covariance both ways, in time and along tracks. What lasts along the tracks is counted
/// by its correlation, which all tracks together determine well (Newey & West 1987, with an exponential kernel that is
/// fitted); blocks of time, as long as five times that correlation where at least six fit, add what scatters beyond it.
/// Tracks count where their scatter is beyond chance (three of its σ): a few of them say little. Cameron, Gelbach &
/// Miller, J. Bus. Econ. Stat. 29(2), 2011.
[[nodiscard]] StatedCovariance stated_covariance(const Adjustment& reference, const ObserveNuisances& nuisances);

/// What lasts in the residuals along the tracks, for a correlation c exp(−t/τ): c is the share of the noise that lasts,
/// the rest is white. From the mean lag of their correlation, freed of what the points' bearings take of it.
struct LastingErrors {
  double seconds = 0.0;  ///< τ; 0: white noise.
  double share = 0.0;    ///< c
  double lost = 0.0;     ///< Of the noise's variance, to the bearings.
};
[[nodiscard]] LastingErrors lasting_errors(const Adjustment& reference);

/// Share of a sum's variance that is seen within blocks of length `block_s`, for a correlation exp(−t/τ).
[[nodiscard]] double seen_within(double block_s, double correlation_s);

/// A residual's weight, normalised: Huber's over σ².
[[nodiscard]] double residual_weight(const Adjustment& reference, std::size_t observation);

}  // namespace alidade
