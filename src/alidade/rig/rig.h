#pragma once

#include <map>
#include <span>

#include "alidade/estimation/progress.h"
#include "alidade/rig/report.h"

namespace alidade {

/// Axes, offsets and mountings of pan-tilt heads, and their relative poses, by maximum likelihood from views of static
/// boards; readings are noisy and are corrected view by view. Lenses are known.
/// Needs no initial guess and does not throw because of bad data: see the status of the report. `cameras`: by head id.
/// docs/maths/pan-tilt-heads.md. Throws Interrupted.
[[nodiscard]] RigReport calibrate_rig(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                                      const std::map<int, Camera>& cameras, const RigConfig& config,
                                      const Progress& progress = {});

/// The same; causes that its residuals indicate are estimated too, one after another.
[[nodiscard]] RigReport calibrate_rig_by_need(std::span<const HeadView> views,
                                              std::span<const Eigen::Vector3d> points_in_board,
                                              const std::map<int, Camera>& cameras, const RigConfig& config,
                                              const Progress& progress = {});

/// The verdict on the estimate, or why there is none, and what to add.
[[nodiscard]] Verdict rig_verdict(const RigReport& report, const RigConfig& config);

/// Covariance (right perturbation: translation, rotation) of cam_from_cam(first, second) of two heads at these
/// readings, from rig.cov; for one head (the same index twice): of its camera relative to that at `first_rad`.
[[nodiscard]] Eigen::Matrix<double, 6, 6> relative_covariance(const Rig& rig, std::size_t first,
                                                              const Eigen::Vector2d& first_rad, std::size_t second,
                                                              const Eigen::Vector2d& second_rad);

}  // namespace alidade
