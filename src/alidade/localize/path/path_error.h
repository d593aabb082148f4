#pragma once

#include <span>

#include "alidade/geometry/similarity.h"
#include "alidade/localize/localization.h"

namespace alidade {

constexpr double same_time_s = 0.01;

/// The pose nearest in time, or null if none is within `tolerance_s`. `poses` must be in order of time.
[[nodiscard]] const TimedPose* nearest_pose(std::span<const TimedPose> poses, double t_s,
                                            double tolerance_s = same_time_s);

/// Compares each estimated pose with the true one at its time. `covs`: covariance of each estimated pose (right
/// perturbation: translation [m], rotation [rad]), or empty.
[[nodiscard]] PathError path_error(std::span<const TimedPose> estimated, std::span<const TimedPose> truth,
                                   bool is_rigid, std::span<const Eigen::Matrix<double, 6, 6>> covs = {});

}  // namespace alidade
