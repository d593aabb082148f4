#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/network/moving_solve.h"
#include "alidade/network/path_spline.h"
#include "alidade/network/report.h"

namespace alidade {

/// Derivative of an observation by a relative change of its lens's focal lengths, both alike [px].
[[nodiscard]] Eigen::Vector2d J_px_focal(const MovingState& state, std::span<const TurnedHead> turned,
                                         const SolvedObservation& observation, const PathSpline::Support& at);

/// What the residuals would gain if the focal length of one camera were free: score tests, one linearisation, poses,
/// clocks and path following. `wide`: the system at the solution, solved without damping, with a focal length of each
/// placed head behind the shared parameters. Scores scatter over blocks of time, about what the freed one leaves.
[[nodiscard]] std::vector<FocalScore> focal_scores(const MovingProblem& problem, const SolvedMoving& solved,
                                                   const PathSystem& wide);

}  // namespace alidade
