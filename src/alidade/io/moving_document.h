#pragma once

#include <span>

#include "alidade/io/result_document.h"
#include "alidade/rig/moving_target.h"

namespace alidade {

/// Puts cameras placed by a moving target into a result: heads, cameras (clock, noise, sights), scale, the true path's
/// fit, the covariance, and the path and the cameras as tables.
void fill_moving_target(std::span<const TargetSight> sights, const MovingTargetReport& report,
                        ResultDocument& document);

/// The sights of the placed cameras on the rig's one clock, in order of time: what `alidade track` reads.
[[nodiscard]] std::vector<TargetSight> sights_on_one_clock(std::span<const TargetSight> sights,
                                                           const MovingTargetReport& report);

/// Text of path.csv: `t_s,x_m,y_m,z_m`.
[[nodiscard]] std::string moving_path_csv(const MovingTargetReport& report);

}  // namespace alidade
