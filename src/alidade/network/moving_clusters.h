#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/network/moving_solve.h"

namespace alidade {

/// What the observations say of the shared parameters once the path follows them, and of what they were given.
struct MovingClusters {
  ClusterCovariance of_time;             ///< Blocks of time, all cameras together.
  Eigen::MatrixXd cov;                   ///< Blocks of time and cameras, two ways.
  double block_s = 0.0;                  ///< Length of a block.
  std::vector<Eigen::MatrixXd> by_lens;  ///< One per head: how the shared parameters follow its lens's.
};

/// Errors of observations go together over time (a hand's, a lens's along the target's way) and in a camera (its lens,
/// its shutter): Σ_time + Σ_camera − Σ_both (Cameron, Gelbach & Miller, J. Bus. Econ. Stat. 29, 2011). Blocks of time
/// double from 2 s on to an eighth of the path; those count over which the scores scatter most: what a lens does along
/// the target's way is in no correlogram of residuals that the path has followed. Cameras are few: what they share
/// beyond their blocks counts as far as it is more than its own scatter. `path_by_common`: A⁻¹Wᵀ of the path; `cov`: by
/// the model.
[[nodiscard]] MovingClusters moving_clusters(const MovingProblem& problem, const SolvedMoving& solved,
                                             const Eigen::MatrixXd& path_by_common, const Eigen::MatrixXd& cov);

}  // namespace alidade
