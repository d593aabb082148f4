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

RangefinderConfig given_config(RangefinderMethod method) {
  RangefinderConfig config;
  config.method = method;
  config.sigma_spot_px = 0.3;
  config.sigma_corner_px = 0.2;
  config.sigma_range_m = 0.002;
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

namespace {

/// Readings at which beams are compared.
std::vector<double> test_ranges_m() {
  std::vector<double> ranges_m;
  for (int i = 0; i < 36; ++i) ranges_m.push_back(0.5 + 0.1 * i);
  return ranges_m;
}

double rms_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

}  // namespace

std::vector<double> spot_errors_px(const RangefinderReport& report, const RangefinderSample& sample) {
  constexpr double not_seen_px = 1e3;
  std::vector<double> errors;
  for (const double range_m : test_ranges_m()) {
    const auto predicted = project(report.camera, point_at(report.beam, range_m));
    const auto truth = project(sample.scene.camera, point_at(sample.scene.beam, range_m));
    errors.push_back(predicted && truth ? std::min(not_seen_px, (*predicted - *truth).norm()) : not_seen_px);
  }
  return errors;
}

double reprojection_px(const RangefinderReport& report, const RangefinderSample& sample) {
  return rms_of(spot_errors_px(report, sample));
}

double coordinate_error_m(const RangefinderReport& report, const RangefinderSample& sample) {
  std::vector<double> errors;
  for (const double range_m : test_ranges_m())
    errors.push_back((point_at(report.beam, range_m) - point_at(sample.scene.beam, range_m)).norm());
  return rms_of(errors);
}

}  // namespace alidade::reproduce
