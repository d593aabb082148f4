#include "alidade/reproduce/beam_trials.h"

#include <algorithm>
#include <cmath>

#include "alidade/beam/unit_direction.h"
#include "alidade/simulate/draws.h"

namespace alidade::reproduce {

RangefinderSample draw_rangefinder_sample(const RangefinderSceneConfig& config, const ShotNoise& noise,
                                          std::uint64_t seed) {
  RangefinderSample sample{draw_rangefinder_scene(config, seed), {}, config.camera, points_in_board(config.board)};
  sample.simulated = simulate_shots(sample.scene, noise, seed + 1000003);
  Draws draws(seed + 2000003);
  Eigen::VectorXd values = params(config.camera.lens);
  for (Eigen::Index i = 0; i < values.size(); ++i) values[i] += std::sqrt(config.camera.cov(i, i)) * draws.normal();
  sample.camera.lens = with_params(config.camera.lens, values);
  return sample;
}

RangefinderConfig told_config(RangefinderMethod method) {
  RangefinderConfig config;
  config.method = method;
  config.sigma_spot_px = 0.3;
  config.sigma_corner_px = 0.2;
  config.range_noise = RangeNoise{0.002};
  return config;
}

RangefinderReport solve_sample(const RangefinderSample& sample, const RangefinderConfig& config) {
  return calibrate_rangefinder(sample.simulated.shots, sample.points, sample.camera, config);
}

double origin_error_m(const RangefinderReport& report, const RangefinderSample& sample) {
  return (report.beam.origin_in_cam - sample.scene.beam.origin_in_cam).norm();
}

Eigen::Vector2d direction_error_rad(const RangefinderReport& report, const RangefinderSample& sample) {
  return tangent_basis(report.beam.direction_in_cam).transpose() * sample.scene.beam.direction_in_cam;
}

double reprojection_px(const RangefinderReport& report, const RangefinderSample& sample) {
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

}  // namespace alidade::reproduce
