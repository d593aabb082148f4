#pragma once

#include <array>
#include <cmath>
#include <utility>

namespace alidade {

/// exp(−dt/τ) and 1 − exp(−dt/τ) over the steps of a log: a regular one has two lengths, but for rounding.
class Decay {
 public:
  explicit Decay(double tau_s) : tau_s_(tau_s) {}
  struct Values {
    double dt_s = -1.0, decay = 1.0, rise = 0.0;
  };
  Values over(double dt_s) {
    constexpr double rounding = 1e-9;  // of τ: its square is lost in a double
    for (const Values& known : known_) {
      const double by = (dt_s - known.dt_s) / tau_s_;
      if (std::abs(by) < rounding) return {dt_s, known.decay - known.decay * by, known.rise + known.decay * by};
    }
    std::swap(known_[0], known_[1]);
    return known_[0] = {dt_s, std::exp(-dt_s / tau_s_), -std::expm1(-dt_s / tau_s_)};
  }

 private:
  double tau_s_;
  std::array<Values, 2> known_{};
};

}  // namespace alidade
