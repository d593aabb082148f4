#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/servo/identify/identify.h"

namespace alidade {

/// One nonlinearity, its apparent size, and its score in σ.
struct ServoCause {
  std::string name;  ///< "a limit of its rate"
  double size = 0.0;
  std::string unit;
  double sigmas = 0.0;
};

/// Score tests of the nonlinearities that were not freed: for a few sizes each, their effect on the response regressed
/// on the residuals with the parameters following. The one that explains most comes first.
[[nodiscard]] std::vector<ServoCause> servo_causes(std::span<const ServoSample> log,
                                                   const ServoIdentification& identified);

/// Number of absolute command sizes in the log that differ by a tenth, up to `most`. With a single size,
/// a limit that it reaches looks like another gain.
[[nodiscard]] std::size_t num_sizes(std::span<const ServoSample> log, std::size_t most);

/// Resolution of the encoder, if all angles are multiples of it; 0: none found.
[[nodiscard]] double encoder_step_rad(std::span<const ServoSample> log);

/// Includes in the fit's covariance the effect of a dead band and backlash of typical sizes that the log hardly shows:
/// each with its prior σ and the information of the residuals (considered parameters, Schmidt–Kalman).
/// `inverse`: (JᵀJ)⁻¹ of the parameters and freed nonlinearities, with derivatives J. They are listed in `counted`.
void count_ordinary_flaws(std::span<const ServoSample> log, const Eigen::MatrixXd& J, const Eigen::MatrixXd& inverse,
                          ServoIdentification& result);

/// The time of a change of gain, time constant or latency, if two plain fits, one to each part of the log,
/// leave white residuals and explain clearly more than the selected model. None for encoders that hold values.
[[nodiscard]] std::optional<ServoChange> servo_change(std::span<const ServoSample> log, const ServoFit& believed);

/// "the latency from 63 to 93 ms".
[[nodiscard]] std::string change_text(const ServoChange& change);

}  // namespace alidade
