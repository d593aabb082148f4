#pragma once

#include <span>
#include <vector>

#include "alidade/servo/identification.h"

namespace alidade {

/// Indices of the parameters in ServoParams.
struct ServoParam {
  enum Place { gain, tau, latency, zero, start };
};

/// Angles that a servo of these parameters reads at the times of a log, and their derivatives. Exact for piecewise
/// constant commands: from one instant to the next in closed form, a switch of the command moving with the latency.
/// Before the log the first command is taken to have been there.
struct ServoResponse {
  Eigen::VectorXd angle_rad;
  Eigen::Matrix<double, Eigen::Dynamic, num_servo_params> J;
};
[[nodiscard]] ServoResponse servo_response(std::span<const ServoSample> log, ServoKind kind, const ServoParams& params);

/// Least squares over both kinds of plant, from a search over time constant and latency (the rest is linear) refined by
/// Gauss–Newton with analytic derivatives. The rate plant is selected where its residuals are clearly smaller.
/// G. H. Golub & V. Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares problems whose
/// variables separate", 1973. A given kind is used. Where the residuals indicate it, nonlinearities are estimated as
/// well: freed one after the other, each where its evidence justifies its parameter. At least 8 rows, in order of time.
[[nodiscard]] ServoIdentification identify_servo(std::span<const ServoSample> log,
                                                 ServoKindRule rule = ServoKindRule::automatic);

/// Whether the model is accepted; otherwise what the log lacks.
[[nodiscard]] Verdict identify_verdict(std::span<const ServoSample> log, const ServoIdentification& identified);

}  // namespace alidade
