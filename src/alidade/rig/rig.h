#pragma once

#include <map>
#include <span>

#include "alidade/estimation/progress.h"
#include "alidade/rig/report.h"

namespace alidade {

/// Axes, offsets and mounting of pan-tilt heads, and their relative poses, from views of static
/// boards, by maximum likelihood; readings have noise of their own and are corrected view by view. Lenses are known.
/// Needs no initial guess and does not throw on bad data: the report says how it went. `cameras`: by id of the head.
/// docs/maths/pan-tilt-heads.md. Throws Interrupted.
[[nodiscard]] RigReport calibrate_rig(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                                      const std::map<int, Camera>& cameras, const RigConfig& config,
                                      const Progress& progress = {});

/// The same, and causes indicated by its residuals are estimated too, one after another.
[[nodiscard]] RigReport calibrate_rig_by_need(std::span<const HeadView> views,
                                              std::span<const Eigen::Vector3d> points_in_board,
                                              const std::map<int, Camera>& cameras, const RigConfig& config,
                                              const Progress& progress = {});

/// The verdict on the estimate, or why there is none, and what to add.
[[nodiscard]] Verdict rig_verdict(const RigReport& report, const RigConfig& config);

/// Covariance (translation, rotation; on the right) of cam_from_cam(first, second) of two heads at these readings, by
/// the covariance of the rig; of one head (the same index): of its camera against where it is at `first_rad`.
[[nodiscard]] Eigen::Matrix<double, 6, 6> relative_covariance(const Rig& rig, std::size_t first,
                                                              const Eigen::Vector2d& first_rad, std::size_t second,
                                                              const Eigen::Vector2d& second_rad);

}  // namespace alidade
