#pragma once

#include "alidade/observe/filters/frame_variation.h"
#include "alidade/observe/solve/solve_once.h"

namespace alidade {

/// The configuration that estimates what is needed to explain all rows with less noise than `max_noise_px`:
/// the simplest of those that fit about as well as the best. None: no set does. For reports whose residuals
/// exceed the noise of points or that detected zooms, where tests of single causes fail.
[[nodiscard]] std::optional<ObserveSetup> searched_causes(const RotationLog& log, const ObserveSetup& config,
                                                          const ObserveSolution& report, double max_noise_px,
                                                          const Progress& progress);

/// The rotation of the camera on its mount at one instant (a bump) that explains all rows with less noise than
/// `max_noise_px` and than `max_share` of the noise without it. For logs that no single camera explains.
[[nodiscard]] std::optional<MountingStep> mounting_step(const RotationLog& log, const ObserveSetup& config,
                                                        const ObserveSolution& report, double max_noise_px,
                                                        double max_share, const Progress& progress);

/// Whether the focal length changes within most seconds of the log, i.e. a linear drift explains them clearly better
/// than a constant.
[[nodiscard]] bool has_no_rest(const RotationLog& log, const ObserveSetup& config, const ObserveSolution& report,
                               const Progress& progress);

}  // namespace alidade
