#pragma once

#include <algorithm>
#include <cmath>

#include "alidade/estimation/motion_models.h"
#include "alidade/reproduce/track_trials.h"
#include "alidade/simulate/draws.h"

namespace alidade::testing {

using reproduce::observations_of;
using reproduce::truth_of;

/// A path by white acceleration of ConstantVelocity{sigma_a}, drawn every 0.05 s and straight between.
inline std::function<Eigen::Vector3d(double)> drawn_path(const Eigen::Vector3d& start, double sigma_a,
                                                         double duration_s, std::uint64_t seed) {
  Draws draws(seed + 77000);
  const double q = ConstantVelocity{sigma_a}.density(), dt_s = 0.05;
  Eigen::Vector3d p = start, v = 0.1 * draws.normal3();
  std::vector<Eigen::Vector3d> path{p};
  const int steps = static_cast<int>(duration_s / dt_s + 0.5);
  for (int k = 0; k < steps + 1; ++k) {
    const Eigen::Vector3d a = draws.normal3(), b = draws.normal3();
    // The factor of [Δ³/3, Δ²/2; Δ²/2, Δ].
    p += dt_s * v + std::sqrt(q * dt_s) * dt_s * (0.5 * a + b / std::sqrt(12.0));
    v += std::sqrt(q * dt_s) * a;
    path.push_back(p);
  }
  return [path, dt_s, steps](double t_s) {
    const double at = std::clamp(t_s / dt_s, 0.0, steps + 0.999);
    const auto i = static_cast<std::size_t>(at + 1e-9);
    const double share = std::max(0.0, at - static_cast<double>(i));
    return Eigen::Vector3d((1.0 - share) * path[i] + share * path[i + 1]);
  };
}

}  // namespace alidade::testing
