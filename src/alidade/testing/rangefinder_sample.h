#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "alidade/beam/unit_direction.h"
#include "alidade/rangefinder/rangefinder.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/example_camera.h"
#include "alidade/simulate/rangefinder.h"

namespace alidade::testing {

/// A simulated log, and the camera as an earlier calibration would have it: the truth with an error of its covariance.
struct RangefinderSample {
  RangefinderScene scene;
  SimulatedShots simulated;
  Camera camera;
  std::vector<Eigen::Vector3d> points;
};

inline RangefinderSample draw_rangefinder_sample(const RangefinderSceneConfig& config, const ShotNoise& noise,
                                                 std::uint64_t seed) {
  RangefinderSample sample{draw_rangefinder_scene(config, seed), {}, config.camera, points_in_board(config.board)};
  sample.simulated = simulate_shots(sample.scene, noise, seed + 1000003);
  Draws draws(seed + 2000003);
  Eigen::VectorXd values = params(config.camera.lens);
  for (Eigen::Index i = 0; i < values.size(); ++i) values[i] += std::sqrt(config.camera.cov(i, i)) * draws.normal();
  sample.camera.lens = with_params(config.camera.lens, values);
  return sample;
}

/// With the noise that the simulator makes told to the estimator.
inline RangefinderConfig told_config(RangefinderMethod method) {
  RangefinderConfig config;
  config.method = method;
  config.sigma_spot_px = 0.3;
  config.sigma_corner_px = 0.2;
  config.range_noise = RangeNoise{0.002};
  return config;
}

inline RangefinderReport solve_sample(const RangefinderSample& sample, const RangefinderConfig& config) {
  return calibrate_rangefinder(sample.simulated.shots, sample.points, sample.camera, config);
}

inline double origin_error_m(const RangefinderReport& report, const RangefinderSample& sample) {
  return (report.beam.origin_in_cam - sample.scene.beam.origin_in_cam).norm();
}

/// Truth minus estimate, in the tangent basis of the estimate. [rad]
inline Eigen::Vector2d direction_error_rad(const RangefinderReport& report, const RangefinderSample& sample) {
  return tangent_basis(report.beam.direction_in_cam).transpose() * sample.scene.beam.direction_in_cam;
}

/// RMS distance of predicted and true spots at 0.5, 0.6, …, 4 m, estimated camera and beam against the true ones. Where
/// one of them is not seen it counts as 1000 px. [px]
inline double reprojection_px(const RangefinderReport& report, const RangefinderSample& sample) {
  double sum = 0.0;
  constexpr int num_ranges = 36;
  for (int i = 0; i < num_ranges; ++i) {
    const double range_m = 0.5 + 0.1 * i;
    const auto predicted = project(report.camera, point_at(report.beam, range_m));
    const auto truth = project(sample.scene.camera, point_at(sample.scene.beam, range_m));
    sum += predicted && truth ? std::min(1e6, (*predicted - *truth).squaredNorm()) : 1e6;
  }
  return std::sqrt(sum / num_ranges);
}

/// The p-quantile, by the sample nearest to it.
inline double quantile_of(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(p * static_cast<double>(values.size() - 1) + 0.5)];
}

}  // namespace alidade::testing
