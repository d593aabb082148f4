#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/network/moving_solve.h"

namespace alidade {

/// Covariance of the shared parameters with the path eliminated, and their sensitivity to given quantities.
struct MovingClusters {
  ClusterCovariance of_time;             ///< Blocks of time, all cameras together.
  Eigen::MatrixXd cov;                   ///< Blocks of time and cameras, two ways.
  double block_s = 0.0;                  ///< Length of a block.
  std::vector<Eigen::MatrixXd> by_lens;  ///< One per head: ∂ shared parameters / ∂ parameters of its lens.
};

/// Errors of observations are correlated in time (a hand's, a lens's along the target's path) and within a camera (its
/// lens, its shutter): Σ_time + Σ_camera − Σ_both (Cameron, Gelbach & Miller, J. Bus. Econ. Stat. 29, 2011). Blocks of
/// time double from 2 s to an eighth of the path; those with the largest scatter of scores are used: the effect of a
/// lens along the target's path is in no correlogram of residuals that the path has absorbed. Cameras are few: what
/// they share beyond their blocks is included as far as it exceeds its own scatter. `path_by_common`: A⁻¹Wᵀ of the
/// path; `cov`: by the model.
[[nodiscard]] MovingClusters moving_clusters(const MovingProblem& problem, const SolvedMoving& solved,
                                             const Eigen::MatrixXd& path_by_common, const Eigen::MatrixXd& cov);

}  // namespace alidade
