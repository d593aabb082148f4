#pragma once

#include "alidade/observe/filters/frame_variation.h"
#include "alidade/observe/solve/solve_once.h"

namespace alidade {

/// The configuration that frees what explains all rows with less noise than `max_noise_px`: the simplest of those that
/// do about as well as any. None: nothing does. For reports whose residuals are more than points' noise, or that saw
/// zooms, where tests of one cause at a time do not see it.
[[nodiscard]] std::optional<ObserveSetup> searched_causes(const RotationLog& log, const ObserveSetup& config,
                                                          const ObserveSolution& report, double max_noise_px,
                                                          const Progress& progress);

/// The rotation of the camera on its mount at one instant (a bump) that explains all rows with less noise than
/// `max_noise_px` and than `max_share` of what there is without. For logs that no one camera explains.
[[nodiscard]] std::optional<MountingStep> mounting_step(const RotationLog& log, const ObserveSetup& config,
                                                        const ObserveSolution& report, double max_noise_px,
                                                        double max_share, const Progress& progress);

/// Does the focal length change within most seconds of the log, so that one that grows or shrinks explains them clearly
/// better?
[[nodiscard]] bool has_no_rest(const RotationLog& log, const ObserveSetup& config, const ObserveSolution& report,
                               const Progress& progress);

}  // namespace alidade
