#pragma once

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/observe/frame_buffer.h"

namespace alidade {

/// Covariance of an adjustment whose residuals share errors, in time (blur, a late clock, noise of the angles) and
/// along the track of a point, and why it differs from that of the model.
struct StatedCovariance {
  CommonMatrix cov;      ///< Covariance of the shared parameters, normalised; nowhere below the model's.
  CommonMatrix lasting;  ///< Covariance with lasting errors along tracks as estimated, without other shared errors.
  Eigen::VectorXd inflation;  ///< σ over the model's.
  ClusterCovariance blocks;   ///< Blocks of time.
  double correlation_s = 0.0, block_s = 0.0;
  double track_effect = 1.0;  ///< Variance of the tracks' scores over that expected from lasting errors.
  bool counts_tracks = false;
};

/// Cluster-robust covariance in two ways, in time and along tracks. Errors that last along tracks are
/// counted by their correlation, which all tracks together determine well (Newey & West 1987, with a
/// fitted exponential kernel); blocks of time, five correlation times long if at least six of them fit,
/// add the scatter beyond that. The scatter between tracks counts if it exceeds chance (by three of its
/// σ), since few tracks determine it poorly. Cameron, Gelbach & Miller, J. Bus. Econ. Stat. 29(2), 2011.
[[nodiscard]] StatedCovariance stated_covariance(const Adjustment& reference, const ObserveNuisances& nuisances);

/// Lasting errors of the residuals along tracks, with correlation c exp(−t/τ): c is the share of the noise that lasts,
/// the rest is white. From the mean lag of the correlation, corrected for what the points' bearings absorb.
struct LastingErrors {
  double seconds = 0.0;  ///< τ; 0: white noise.
  double share = 0.0;    ///< c.
  double lost = 0.0;     ///< Share of the noise's variance that the bearings absorb.
};
[[nodiscard]] LastingErrors lasting_errors(const Adjustment& reference);

/// Share of the variance of a sum that is seen within blocks of length `block_s`, for a correlation exp(−t/τ).
[[nodiscard]] double seen_within(double block_s, double correlation_s);

/// Weight of a residual, normalised: Huber's weight over σ².
[[nodiscard]] double residual_weight(const Adjustment& reference, std::size_t observation);

}  // namespace alidade
