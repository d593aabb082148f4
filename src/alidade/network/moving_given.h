#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/network/moving_solve.h"
#include "alidade/network/moving_target.h"

namespace alidade {

/// What the placing of cameras was given: lenses and a distance, with what they do to it.
struct MovingGiven {
  std::vector<Assumption> assumed;  ///< Moves in σ of `cov`, of the cameras' poses.
  /// Of the shared parameters: the solver's, lenses whose covariance is given, and focal lengths that the observations
  /// half ask to be others.
  Eigen::MatrixXd cov;
  std::vector<FocalScore> focals;
};
[[nodiscard]] MovingGiven moving_given(const MovingProblem& problem, const SolvedMoving& solved,
                                       const MovingTargetConfig& config);

}  // namespace alidade
