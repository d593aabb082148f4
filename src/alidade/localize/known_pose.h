#pragma once

#include <span>
#include <vector>

#include "alidade/localize/filter/filter_bank.h"
#include "alidade/localize/target.h"

namespace alidade {

/// Where a camera is that sees these known points: of points in a plane (or nearly) both poses that a flat target
/// nearly has, by maximum likelihood, the better one first, with their covariance; speeds zero with these σ. Of more
/// than four points those that do not fit are rejected. Where no pose fits a plane through the points, and they are in
/// none, poses from sets of three of them (three_point_pose.h). Empty where fewer than four are seen, they are on a
/// line, or no pose fits (χ² beyond 99.9 %): observations that show another point.
struct KnownPoseConfig {
  double sigma_px = 0.5;
  double sigma_speed_m_s = 0.3, sigma_rate_rad_s = 0.3;
};
[[nodiscard]] std::vector<StartHypothesis> poses_from_known(const Camera& camera,
                                                            std::span<const FeatureObservation> observations,
                                                            std::span<const KnownPoint> known,
                                                            const KnownPoseConfig& config = {});

/// The same starts as initial guesses and no more: σ of the pose ten times as wide, all at the same cost. For when
/// the observations that led to them follow as a measurement: a hundredth of them then counts twice, and not all.
[[nodiscard]] std::vector<StartHypothesis> only_where(std::vector<StartHypothesis> starts);

}  // namespace alidade
