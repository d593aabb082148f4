#pragma once

#include <complex>
#include <vector>

#include "alidade/pantilt/servo_plant.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The unit of a loop's error; gains refer to it.
enum class ErrorUnit { px, deg, rad };

/// PI controller C(s) = kp + ki/s, from error to command.
struct PiGains {
  double kp = 2.0;   ///< Xiahou, Chen & Wu, 2015: 2 + 10/s, for errors in px.
  double ki = 10.0;  ///< [1/s]
  ErrorUnit unit = ErrorUnit::px;
  bool operator==(const PiGains&) const = default;

  /// The same gains for an error in radians; `focal_px`, the focal length, is the number of pixels per radian.
  [[nodiscard]] PiGains per_rad(double focal_px) const;
};

/// Loop in continuous time, L(s) = K (kp + ki/s) G(s) with K = error units per unit of the plant's output: without
/// hold, delays and second lag.
struct ContinuousLoop {
  std::vector<std::complex<double>> poles;  ///< Of the closed loop, the slowest last. [rad/s]
  double bandwidth_rad_s = 0.0;             ///< Where the closed loop is down by 3 dB.
  double crossover_rad_s = 0.0;             ///< Where |L| = 1; 0: nowhere.
  double phase_margin_deg = 0.0;
};

/// A sampled PI loop around a plant: command u_k = kp e_k + ki Σ_{i<k} e_i T with zero-order hold, delayed errors and
/// commands, and the second lag of the command. L(z) at z = exp(jωT), below half the sampling rate.
struct LoopAnalysis {
  double bandwidth_rad_s = 0.0;   ///< Where the closed loop is down by 3 dB; 0: nowhere.
  double crossover_rad_s = 0.0;   ///< Where |L| = 1, the one nearest to instability; 0: nowhere.
  double phase_margin_deg = 0.0;  ///< At the crossover; below 0: unstable.
  /// Spectral radius: largest |eigenvalue| of the loop. Below 1: stable.
  double sampled_radius = 0.0;
  ContinuousLoop continuous;

  [[nodiscard]] bool is_stable() const { return sampled_radius < 1.0; }
};

/// Analysis of a loop whose error is `delay_samples` old. Gains in rad (PiGains::per_rad); limits of rate and
/// acceleration, dead band, backlash and stops are ignored.
[[nodiscard]] LoopAnalysis analysed(const ServoAxis& axis, const PiGains& per_rad, double period_s,
                                    int delay_samples = 0);
/// For a plant without command delay.
[[nodiscard]] LoopAnalysis analysed(const ServoPlant& plant, const PiGains& per_rad, double period_s,
                                    int delay_samples = 0);

ALIDADE_PUBLIC_END
}  // namespace alidade
