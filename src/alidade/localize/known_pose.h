#pragma once

#include <span>
#include <vector>

#include "alidade/localize/filter/filter_bank.h"
#include "alidade/localize/target.h"

namespace alidade {

/// Camera poses from observations of known points. For (nearly) coplanar points both poses of the flat-target
/// ambiguity, by maximum likelihood, the better one first, with covariance; velocities are zero with these σ. With more
/// than four points outliers are rejected. If no pose fits a plane through the points and they are not coplanar, poses
/// from triples of them (three_point_pose.h). Empty: fewer than four points, collinear, or no pose fits (χ² beyond 99.9
/// %) because of mismatches.
struct KnownPoseConfig {
  double sigma_px = 0.5;
  double sigma_speed_m_s = 0.3, sigma_rate_rad_s = 0.3;
};
[[nodiscard]] std::vector<StartHypothesis> poses_from_known(const Camera& camera,
                                                            std::span<const FeatureObservation> observations,
                                                            std::span<const KnownPoint> known,
                                                            const KnownPoseConfig& config = {});

/// The same starts as mere initial guesses: σ of the pose multiplied by ten, all with the same cost. For observations
/// that led to them and follow as a measurement: then only a hundredth of their information counts twice.
[[nodiscard]] std::vector<StartHypothesis> only_where(std::vector<StartHypothesis> starts);

}  // namespace alidade
