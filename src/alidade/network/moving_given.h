#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/network/moving_scale.h"
#include "alidade/network/moving_solve.h"
#include "alidade/network/moving_target.h"

namespace alidade {

/// Given quantities behind the cameras' poses, lenses and a distance, with their effect on the result.
struct MovingGiven {
  std::vector<Assumption> assumed;  ///< `moves` in σ of `cov`, of the cameras' poses.
  /// Of the shared parameters: from the solver, from lenses with a given covariance, and from focal lengths that the
  /// observations contradict, though not significantly.
  Eigen::MatrixXd cov;
  std::vector<CameraScore> scores;
};
[[nodiscard]] MovingGiven moving_given(const MovingProblem& problem, const SolvedMoving& solved,
                                       const MovingTargetConfig& config);

/// Fills in the report's covariance of the heads, which are already in their world: including that of the similarity,
/// if a true path gave it (`match`; else nullptr), and the worst camera's σ in the frame of the reference.
void take_covariance(const MovingProblem& problem, const MovingGiven& given, const Eigen::MatrixXd& cov_model,
                     const PathMatch* match, MovingTargetReport& report);

}  // namespace alidade
