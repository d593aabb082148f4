#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "alidade/servo/identify/identify.h"
#include "alidade/simulate/servo.h"

namespace alidade::testing {

/// What `alidade identify` reads of a simulated axis.
inline std::vector<ServoSample> log_of(const ServoLogScene& scene, std::uint64_t seed = 1) {
  std::vector<ServoSample> log;
  for (const ServoLogRow& row : simulate_servo_log(scene, seed)) log.push_back({row.t_s, row.command, row.angle_rad});
  return log;
}

/// The paper's axis, or a rate plant without limits, 83 ms late.
inline ServoLogScene late_scene(bool is_rate_plant, RatePlant plant = {0.005, AngleUnit::rad, 0.08}) {
  ServoLogScene scene;
  plant.max_rate_rad_s = plant.max_acceleration_rad_s2 = 1e9;
  if (is_rate_plant) scene.axis.plant = plant;
  scene.axis.command_delay_s = 0.083;
  return scene;
}

/// Of gain, time constant or latency.
inline double error_in_sigma(const ServoFit& fit, const ServoLogScene& scene, int param) {
  const ServoAxis& axis = scene.axis;
  const std::array<double, 3> truth{gain_of(axis.plant), tau_of(axis.plant), axis.command_delay_s};
  return (fit.params[param] - truth[static_cast<std::size_t>(param)]) / std::sqrt(fit.cov(param, param));
}

/// 2.5 s of it, and a fit as a response is asked of, with τ 0.1 s, latency 83 ms and zero 0.2 rad.
struct LogAndFit {
  std::vector<ServoSample> log;
  ServoFit fit;
};
inline LogAndFit short_log_and_fit(bool is_rate_plant) {
  ServoLogScene scene = late_scene(is_rate_plant);
  scene.duration_s = 2.5;
  LogAndFit sample{log_of(scene, 1), {}};
  sample.fit.kind = is_rate_plant ? ServoKind::rate : ServoKind::angle;
  sample.fit.params << gain_of(scene.axis.plant), 0.1, 0.083, 0.2, 0.0;
  return sample;
}

}  // namespace alidade::testing
