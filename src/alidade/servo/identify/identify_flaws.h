#pragma once

#include <span>
#include <vector>

#include "alidade/servo/identify/identify.h"

namespace alidade {

/// Indices in servo_flaws.
struct ServoFlaw {
  enum Place : std::size_t {
    rate_limit,
    acceleration_limit,
    dead_band,
    backlash,
    second_lag,
    clock_rate,
    earlier_command,
    gain_difference,
    gain_drift
  };
};

/// The log's, not the axis'.
[[nodiscard]] constexpr bool is_of_the_log(std::size_t flaw) {
  return flaw == ServoFlaw::clock_rate || flaw == ServoFlaw::earlier_command;
}

/// Angles that a servo of this fit, with its flaws, reads at the times of the log. In closed form, but for a second
/// lag, which is stepped through.
[[nodiscard]] Eigen::VectorXd flawed_response(std::span<const ServoSample> log, const ServoFit& fit,
                                              const ServoFlaws& flaws);

/// ∂ response / ∂ (parameters in their order, flaws that were freed), by differences.
[[nodiscard]] Eigen::MatrixXd flawed_jacobian(std::span<const ServoSample> log, const ServoFit& fit);

/// Response − readings.
[[nodiscard]] Eigen::VectorXd flawed_misfit(std::span<const ServoSample> log, const ServoFit& fit);

/// Levenberg–Marquardt over parameters and freed flaws. Returns the sum of squared residuals.
double refine_flawed(std::span<const ServoSample> log, int max_steps, ServoFit& fit);

/// Rows that do not share errors: of an AR(1) noise with the residuals' correlation from row to row.
[[nodiscard]] double effective_rows(const Eigen::VectorXd& misfit);

/// What a fit leaves, and the directions in which its parameters can follow.
struct FlawGround {
  Eigen::VectorXd response, misfit;  ///< misfit = response − readings.
  Eigen::MatrixXd across;            ///< Orthonormal, of the Jacobian's columns.
};
[[nodiscard]] FlawGround flaw_ground(std::span<const ServoSample> log, const ServoFit& fit);

/// How much of Σ misfit² a flaw of a size explains, by one linearisation with the parameters following.
struct FlawScore {
  double size = 0.0, gain2 = 0.0;
};
/// Of a few sizes, the one that explains most first.
[[nodiscard]] std::vector<FlawScore> flaw_scores(std::span<const ServoSample> log, const ServoFit& fit,
                                                 const FlawGround& ground, std::size_t flaw);

/// The fit with every one of these flaws that the log supports, one after the other: 2 ln of the likelihood ratio,
/// counted in rows that do not share errors, above ln n + 12 (Schwarz's criterion, and a margin for the choice among
/// flaws and sizes). Of an angle plant the limits of rate and acceleration are tried together as well, where one alone
/// leaves structure. `rivals`: flaws that explain the same nearly as well. G. Schwarz, "Estimating the dimension of a
/// model", 1978.
[[nodiscard]] ServoFit with_flaws(std::span<const ServoSample> log, const ServoFit& plain,
                                  std::span<const std::size_t> flaws, std::vector<ServoRival>& rivals);

/// Dead band, backlash and a limit of the rate, each of a typical size, that the log would not show: with it the rest
/// fits equally well.
[[nodiscard]] std::vector<HiddenFlaw> hidden_flaws(std::span<const ServoSample> log, const ServoFit& fit);

}  // namespace alidade
