#pragma once

#include <complex>
#include <vector>

#include "alidade/pantilt/servo_plant.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The unit of a loop's error; gains refer to it.
enum class ErrorUnit { px, deg, rad };

/// C(s) = kp + ki/s, from error to command.
struct PiGains {
  double kp = 2.0;   ///< Xiahou, Chen & Wu, 2015: 2 + 10/s, px.
  double ki = 10.0;  ///< [1/s]
  ErrorUnit unit = ErrorUnit::px;
  bool operator==(const PiGains&) const = default;

  /// The same gains for an error in radians, where a radian is so many pixels (the focal length).
  [[nodiscard]] PiGains per_rad(double focal_px) const;
};

/// A PI loop round a plant: L(s) = K (kp + ki/s) G(s), with K = error units per unit of the plant's output.
struct LoopAnalysis {
  std::vector<std::complex<double>> poles;  ///< Of the continuous closed loop, slowest last. [rad/s]
  double bandwidth_rad_s = 0.0;             ///< Where the closed loop has fallen by 3 dB.
  double crossover_rad_s = 0.0;             ///< Where |L| = 1; 0: nowhere.
  double phase_margin_deg = 0.0;
  /// Largest |eigenvalue| of the loop, sampled with zero-order hold: command u_k = kp e_k + ki Σ_{i<k} e_i T. Below 1:
  /// stable.
  double sampled_radius = 0.0;

  [[nodiscard]] bool is_stable() const { return sampled_radius < 1.0; }
};

/// Analysis of a loop whose error is seen `delay_samples` late. Gains in rad (PiGains::per_rad), within a linear
/// plant's limits.
[[nodiscard]] LoopAnalysis analysed(const ServoPlant& plant, const PiGains& per_rad, double period_s,
                                    int delay_samples = 0);

ALIDADE_PUBLIC_END
}  // namespace alidade
