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

/// Derivative of an observation with respect to the tested parts of its camera, in the order of CameraPart [px]; 0 for
/// its clock if clocks are free.
[[nodiscard]] Eigen::Matrix<double, 2, num_camera_parts> J_px_parts(const MovingProblem& problem,
                                                                    const MovingState& state,
                                                                    std::span<const TurnedHead> turned,
                                                                    const SolvedObservation& observation,
                                                                    const PathSpline::Support& at);

/// Score tests: the gain in the residuals if a part of one camera were free, by one linearisation, poses,
/// clocks and path following. `wide`: the system at the solution, solved without damping, with num_camera_parts columns
/// for each placed head after the shared parameters. The scatter of scores is over blocks of time, about what the freed
/// part leaves. `given`: effect of the files' errors, as these state them.
[[nodiscard]] std::vector<CameraScore> camera_scores(const MovingProblem& problem, const SolvedMoving& solved,
                                                     const PathSystem& wide);

/// Index of a part among the parameters of its lens; none if the lens does not have it.
[[nodiscard]] std::optional<Eigen::Index> lens_param_of(const Camera& camera, CameraPart part);

}  // namespace alidade
