#pragma once

#include <span>

#include "alidade/network/moving_target.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// Puts cameras placed by a moving target into a result: heads, cameras (clock, noise, observations), scale, the true
/// path's fit, the covariance, and the path and the cameras as tables.
void fill_moving_target(std::span<const TargetObservation> observations, const MovingTargetReport& report,
                        ResultDocument& document);

/// The observations of the placed cameras on the rig's one clock, in order of time: what `alidade track` reads.
[[nodiscard]] std::vector<TargetObservation> observations_on_one_clock(std::span<const TargetObservation> observations,
                                                                       const MovingTargetReport& report);

/// Text of path.csv: `t_s,x_m,y_m,z_m`.
[[nodiscard]] std::string moving_path_csv(const MovingTargetReport& report);

}  // namespace alidade
