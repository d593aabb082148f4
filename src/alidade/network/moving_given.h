#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/network/moving_solve.h"
#include "alidade/network/moving_target.h"

namespace alidade {

/// What was given to locate the cameras: lenses and a distance, with their effect on the result.
struct MovingGiven {
  std::vector<Assumption> assumed;  ///< Moves in σ of `cov`, of the cameras' poses.
  /// Of the shared parameters: the solver's, lenses whose covariance is given, and focal lengths that the observations
  /// contradict, but not significantly.
  Eigen::MatrixXd cov;
  std::vector<FocalScore> focals;
};
[[nodiscard]] MovingGiven moving_given(const MovingProblem& problem, const SolvedMoving& solved,
                                       const MovingTargetConfig& config);

}  // namespace alidade
