#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "alidade/geometry/so3.h"
#include "alidade/localize/checks/scale_readings.h"
#include "alidade/simulate/draws.h"

// A camera that sways, with sensors beside it; path and map in metres: the scale is 1.

namespace alidade::testing {

/// A path of three slow oscillations along each axis, with smooth errors of 0.3 mm.
struct Swaying {
  explicit Swaying(std::uint64_t seed, double fastest_hz = 0.25) {
    Draws draws(seed);
    for (Eigen::Matrix3d* each : {&amplitude, &rate, &phase})
      for (double& value : each->reshaped()) value = draws.uniform(0.0, 1.0);
    amplitude = (0.3 + 0.7 * amplitude.array()).matrix();
    const Eigen::Vector3d sizes(0.25, 0.15, 0.12), along(1.0, 0.6, 0.4);
    amplitude = sizes.asDiagonal() * amplitude * along.asDiagonal();
    rate = (2.0 * std::numbers::pi * (0.05 + (fastest_hz - 0.05) * rate.array())).matrix();
    phase *= 2.0 * std::numbers::pi;
  }
  [[nodiscard]] Eigen::Vector3d at(double t_s) const {
    return (amplitude.array() * (rate.array() * t_s + phase.array()).sin()).rowwise().sum();
  }
  /// A camera that is held by hand: up to so much about each axis.
  double turning_rad = 0.0;
  [[nodiscard]] Eigen::Quaterniond attitude(double t_s) const {
    const Eigen::Vector3d turn((rate(0, 1) * t_s + phase(2, 0)), (rate(1, 2) * t_s + phase(2, 1)),
                               (rate(2, 0) * t_s + phase(2, 2)));
    return exp_so3(turning_rad * turn.array().sin().matrix());
  }
  [[nodiscard]] std::vector<PathStep> path(double duration_s) const {
    std::vector<PathStep> steps;
    for (int k = 0; k < 30 * duration_s; ++k) {
      PathStep step;
      step.frame = k;
      step.t_s = k / 30.0;
      step.event = FrameEvent::tracked;
      const Eigen::Vector3d error(std::sin(1.3 * step.t_s), std::sin(0.9 * step.t_s), std::cos(1.1 * step.t_s));
      step.world_from_cam = {attitude(step.t_s), at(step.t_s) + 3e-4 * error};
      steps.push_back(step);
    }
    return steps;
  }
  Eigen::Matrix3d amplitude, rate, phase;
};

struct Drawn {
  int given = 0, beyond_5_sigma = 0, silent = 0, beyond_3_sigma = 0, clocks = 0, filters = 0, jumps = 0, arms = 0,
      drifts = 0;
  double worst = 0.0, largest_sigma = 0.0;

  void add(const std::optional<ReadScale>& read) {
    if (!read) return;
    ++given;
    const double z = std::abs(std::log(read->scale)) / read->sigma_rel;
    beyond_5_sigma += z > 5.0;
    beyond_3_sigma += z > 3.0;
    silent += z > 5.0 && read->late_s == 0.0 && read->lag_s == 0.0 && read->hidden_offset_rel == 0.0 &&
              read->arm_m.isZero(0.0) && !read->is_drifting;
    clocks += read->late_s != 0.0;
    filters += read->lag_s > 0.0;
    jumps += read->jump_m != 0.0;
    arms += !read->arm_m.isZero(0.0);
    drifts += read->is_drifting;
    worst = std::max(worst, z);
    largest_sigma = std::max(largest_sigma, read->sigma_rel);
  }
};

/// Of so many paths: `scale_of(path, seed)`.
template <class ScaleOf>
Drawn drawn_of(int num, const ScaleOf& scale_of) {
  Drawn drawn;
  for (int i = 1; i <= num; ++i) {
    const auto seed = static_cast<std::uint64_t>(i);
    drawn.add(scale_of(Swaying(seed), seed));
  }
  return drawn;
}

}  // namespace alidade::testing
