#pragma once

#include <vector>

#include "alidade/rangefinder/rangefinder.h"
#include "alidade/simulate/rangefinder.h"

// Simulated logs of a rangefinder, and how its beam is scored.

namespace alidade::reproduce {

/// A simulated log, and the camera as an earlier calibration would have it: the truth with an error of its covariance.
struct RangefinderSample {
  RangefinderScene scene;
  SimulatedShots simulated;
  Camera camera;
  std::vector<Eigen::Vector3d> points;
};
[[nodiscard]] RangefinderSample draw_rangefinder_sample(const RangefinderSceneConfig& config, const ShotNoise& noise,
                                                        std::uint64_t seed);

/// With the noise of the simulator given to the estimator.
[[nodiscard]] RangefinderConfig given_config(RangefinderMethod method);

[[nodiscard]] RangefinderReport solve_sample(const RangefinderSample& sample, const RangefinderConfig& config);

[[nodiscard]] double origin_error_m(const RangefinderReport& report, const RangefinderSample& sample);
/// Truth minus estimate, in the tangent basis of the estimate. [rad]
[[nodiscard]] Eigen::Vector2d direction_error_rad(const RangefinderReport& report, const RangefinderSample& sample);
/// Distance of predicted and true spots at 0.5, 0.6, …, 4 m; 1000 px where one of them is not seen. [px]
[[nodiscard]] std::vector<double> spot_errors_px(const RangefinderReport& report, const RangefinderSample& sample);
/// RMS distance of the points that the beam has at these readings from the true ones. [m]
[[nodiscard]] double coordinate_error_m(const RangefinderReport& report, const RangefinderSample& sample);
/// RMS distance of predicted and true spots at 0.5, 0.6, …, 4 m, estimated camera and beam against the true ones. Where
/// one of them is not seen it counts as 1000 px. [px]
[[nodiscard]] double reprojection_px(const RangefinderReport& report, const RangefinderSample& sample);

}  // namespace alidade::reproduce
