#pragma once

#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "alidade/servo/identification.h"

namespace alidade {

/// Indices of the parameters in ServoParams.
struct ServoParam {
  enum Place { gain, tau, latency, zero, start };
};

/// exp(−dt/τ) and 1 − exp(−dt/τ) over the steps of a log: a regular one has two step lengths, up to rounding.
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

/// Angles that a servo with these parameters reads at the times of a log, and their derivatives. Exact for piecewise
/// constant commands: closed form from one instant to the next, with the switching times shifted by the latency.
/// Before the log the first command is assumed to have been in effect.
struct ServoResponse {
  Eigen::VectorXd angle_rad;
  Eigen::Matrix<double, Eigen::Dynamic, num_servo_params> J;
};
[[nodiscard]] ServoResponse servo_response(std::span<const ServoSample> log, ServoKind kind, const ServoParams& params);

/// Least squares for both kinds of plant, by a search over time constant and latency (the rest is linear) refined by
/// Gauss–Newton with analytic derivatives. The rate plant is selected if its residuals are clearly smaller.
/// G. H. Golub & V. Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares problems whose
/// variables separate", 1973. A given kind is used. If the residuals indicate it, nonlinearities are estimated as
/// well: freed one by one, if the evidence justifies the parameter. At least 8 rows, in chronological order.
[[nodiscard]] ServoIdentification identify_servo(std::span<const ServoSample> log,
                                                 ServoKindRule rule = ServoKindRule::automatic);

/// Whether the model is accepted; if not, what the log lacks.
[[nodiscard]] Verdict identify_verdict(std::span<const ServoSample> log, const ServoIdentification& identified);

}  // namespace alidade
