#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/servo/identify/identify.h"

namespace alidade {

/// One flaw, how large it seems, and its score in σ.
struct ServoCause {
  std::string name;  ///< "a limit of its rate"
  double size = 0.0;
  std::string unit;
  double sigmas = 0.0;
};

/// Score tests of the flaws that were not freed: of a few sizes each, what they add to the response regressed on the
/// residuals with the parameters following. The one that explains most, first.
[[nodiscard]] std::vector<ServoCause> servo_causes(std::span<const ServoSample> log,
                                                   const ServoIdentification& identified);

/// Sizes of command that the log has, whatever their sign: of those that differ by a tenth, up to `most`. Of one size
/// alone, a limit that it runs into is another gain.
[[nodiscard]] std::size_t num_sizes(std::span<const ServoSample> log, std::size_t most);

/// The step of the encoder where the angles are its whole multiples; 0: not seen.
[[nodiscard]] double encoder_step_rad(std::span<const ServoSample> log);

/// Includes in the fit's covariance the effect of a dead band and backlash of typical sizes that the log hardly shows:
/// each with its prior σ, less the information of the residuals (Schmidt–Kalman's consider parameters).
/// `inverse`: (JᵀJ)⁻¹ of the parameters and freed flaws, whose derivatives are J. They are listed in `counted`.
void count_ordinary_flaws(std::span<const ServoSample> log, const Eigen::MatrixXd& J, const Eigen::MatrixXd& inverse,
                          ServoIdentification& result);

/// The time from which on gain, time constant or latency are others, if two plain fits, one to each part of the log,
/// leave white residuals and explain clearly more than what is believed. None of held encoders.
[[nodiscard]] std::optional<ServoChange> servo_change(std::span<const ServoSample> log, const ServoFit& believed);

/// "the latency from 63 to 93 ms".
[[nodiscard]] std::string change_text(const ServoChange& change);

}  // namespace alidade
