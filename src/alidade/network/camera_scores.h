#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/network/moving_solve.h"
#include "alidade/network/path_spline.h"
#include "alidade/network/report.h"

namespace alidade {

inline constexpr int num_camera_parts = 10;

/// Derivative of an observation by what is tested of its camera, in the order of CameraPart [px]; by its clock 0 where
/// clocks are free.
[[nodiscard]] Eigen::Matrix<double, 2, num_camera_parts> J_px_parts(const MovingProblem& problem,
                                                                    const MovingState& state,
                                                                    std::span<const TurnedHead> turned,
                                                                    const SolvedObservation& observation,
                                                                    const PathSpline::Support& at);

/// What the residuals would gain if a part of one camera were free: score tests, one linearisation, poses,
/// clocks and path following. `wide`: the system at the solution, solved without damping, with num_camera_parts columns
/// for each placed head behind the shared parameters. Scores scatter over blocks of time, about what the freed one
/// leaves. What errors of the files, as these state them, do to each is `given`.
[[nodiscard]] std::vector<CameraScore> camera_scores(const MovingProblem& problem, const SolvedMoving& solved,
                                                     const PathSystem& wide);

/// Place of a part among the parameters of its lens; none: it has no such.
[[nodiscard]] std::optional<Eigen::Index> lens_param_of(const Camera& camera, CameraPart part);

}  // namespace alidade
