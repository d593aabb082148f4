#pragma once

#include <limits>
#include <optional>
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
    gain_drift,
    gain_by_size,
    command_limit,
    rate_offset,
    soft_rate_limit,
    resonance,  ///< Its frequency; the next two go with it.
    resonance_damping,
    resonance_share
  };
};

/// Gain, zero and start that fit best at a time constant and latency, and what is left.
struct LinearFit {
  ServoParams params = ServoParams::Zero();
  double difference = 0.0;  ///< Of the gain, by the command's sign.
  double sum2 = std::numeric_limits<double>::infinity();
};

/// Every n-th row, so that a search over a long log stays short; commands between are piecewise constant.
[[nodiscard]] std::vector<ServoSample> thinned(std::span<const ServoSample> log);

/// The best of a grid in time constant (by factors) and latency (up to a third of the log). `by_sign`: with a gain that
/// differs by the command's sign.
[[nodiscard]] LinearFit searched(std::span<const ServoSample> log, ServoKind kind, bool by_sign = false);

/// (JᵀJ)⁻¹, by parameters scaled so that their units do not matter; none where it cannot be solved.
[[nodiscard]] std::optional<Eigen::MatrixXd> inverse_normal(const Eigen::MatrixXd& J);

/// ln |A|, by columns scaled so that their units do not matter.
[[nodiscard]] double log_determinant(const Eigen::MatrixXd& A);

/// Levenberg–Marquardt from there; time constant and latency stay within what has a meaning.
[[nodiscard]] ServoFit refined(std::span<const ServoSample> log, ServoKind kind, ServoParams params);

inline constexpr std::size_t num_of_a_resonance = 3;

/// Of the gain, in parts of it: the response is nearly linear in them.
[[nodiscard]] constexpr bool is_of_the_gain(std::size_t flaw) {
  return flaw == ServoFlaw::gain_difference || flaw == ServoFlaw::gain_drift || flaw == ServoFlaw::gain_by_size;
}

/// Whether a plant of this kind can have it by itself: of the other one it is another flaw, or nothing.
[[nodiscard]] constexpr bool is_of_kind(ServoKind kind, std::size_t flaw) {
  if (flaw == ServoFlaw::command_limit) return kind == ServoKind::angle;
  return flaw != ServoFlaw::rate_offset || kind == ServoKind::rate;
}

/// The log's, not the axis'.
[[nodiscard]] constexpr bool is_of_the_log(std::size_t flaw) {
  return flaw == ServoFlaw::clock_rate || flaw == ServoFlaw::earlier_command;
}

/// The largest command, whatever its sign.
[[nodiscard]] double largest_command(std::span<const ServoSample> log);

/// Angles that a servo of this fit, with its flaws, reads at the times of the log. In closed form, but for a second
/// lag, which is stepped through.
[[nodiscard]] Eigen::VectorXd flawed_response(std::span<const ServoSample> log, const ServoFit& fit,
                                              const ServoFlaws& flaws);

/// ∂ response / ∂ (parameters in their order, flaws that were freed), by differences.
[[nodiscard]] Eigen::MatrixXd flawed_jacobian(std::span<const ServoSample> log, const ServoFit& fit);

/// The Jacobian where the response hardly depends, to the first order, on a time constant far below the rows' spacing,
/// beside a resonance or a limit of acceleration, or on how two equal lags are split: with the column of the time
/// constant a difference so wide that it shows.
[[nodiscard]] Eigen::MatrixXd with_open_lag(std::span<const ServoSample> log, const ServoFit& fit, Eigen::MatrixXd J);

/// Includes in the covariance that such a time constant below the rows' spacing may as well be a latency.
void count_short_lag(std::span<const ServoSample> log, ServoFit& fit);

/// Whether the lag is of an acceleration or of what swings, so that the axis needs no other.
[[nodiscard]] bool is_lagged_otherwise(const ServoFit& fit);

/// Whether it has a resonance whose share is within 3σ of none: how much of the latency is its delay 2ζ/ω is then open
/// (`count_short_lag` counts all of it).
[[nodiscard]] bool is_hardly_excited(const ServoFit& fit);

/// Response − readings.
[[nodiscard]] Eigen::VectorXd flawed_misfit(std::span<const ServoSample> log, const ServoFit& fit);

/// Levenberg–Marquardt over parameters and freed flaws. Returns the sum of squared residuals.
double refine_flawed(std::span<const ServoSample> log, int max_steps, ServoFit& fit);

/// From one to the next.
[[nodiscard]] double lag_one_correlation(const Eigen::VectorXd& misfit);

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

/// What a resonance of that damping and a share of one would add to a response: one column for each frequency of a grid
/// up to what the readings resolve.
struct AddedResonances {
  std::vector<double> hz;
  Eigen::MatrixXd added;
};
[[nodiscard]] AddedResonances added_resonances(std::span<const ServoSample> log, const Eigen::VectorXd& response,
                                               double damping);

/// Beyond it a log is said to have a resonance: of a true model's largest score among the grid's frequencies less than
/// one in a thousand is.
inline constexpr double sigmas_of_a_resonance = 4.5;

/// A resonance of some frequency and damping, its share by one linearisation with the parameters following.
struct ResonanceScore {
  double hz = 0.0, damping = 0.0, share = 0.0;
  double sigmas = 0.0;  ///< Its score, where neighbouring rows share errors as what it leaves does.
};

/// The largest score of a grid of frequencies, up to what the readings resolve, and damping ratios. The score's
/// variance is of errors as correlated as those that are left (Bartlett's window). W. K. Newey & K. D. West, "A simple,
/// positive semi-definite, heteroskedasticity and autocorrelation consistent covariance matrix", 1987.
/// `others`: what else may be there, each of whatever size, and no resonance then.
[[nodiscard]] ResonanceScore resonance_score(std::span<const ServoSample> log, const ServoFit& fit, FlawGround ground,
                                             std::span<const ServoFlaws> others = {});

/// Whether it does, beside whatever else the residuals of the fit indicate and that is not in it.
[[nodiscard]] bool asks_for_resonance(std::span<const ServoSample> log, const ServoFit& fit);

/// The fit with a resonance freed, from the best points of a grid in its frequency and damping, and in the time
/// constant and latency, which without it have taken its delay. None: what fits best would not swing.
[[nodiscard]] std::optional<ServoFit> with_resonance(std::span<const ServoSample> log, const ServoFit& fit);

/// Which flaws to try: all where the residuals of a linear fit indicate one of the axis, else those of the log alone.
/// Never a resonance: that is tried when all else has been.
[[nodiscard]] std::vector<std::size_t> indicated_flaws(std::span<const ServoSample> log, const ServoFit& fit);

/// The fit with every one of these flaws that the log supports, one after the other: 2 ln of the likelihood ratio,
/// counted in rows that do not share errors, above ln n + 12 (Schwarz's criterion, and a margin for the choice among
/// flaws and sizes). Of an angle plant the limits of rate and acceleration are tried together as well, where one alone
/// leaves structure. `rivals`: flaws that explain the same nearly as well. G. Schwarz, "Estimating the dimension of a
/// model", 1978.
[[nodiscard]] ServoFit with_flaws(std::span<const ServoSample> log, const ServoFit& start,
                                  std::span<const std::size_t> flaws, std::vector<ServoRival>& rivals);

/// Dead band, backlash and a limit of the rate, each of a typical size, that the log would not show: with it the rest
/// fits equally well.
[[nodiscard]] std::vector<HiddenFlaw> hidden_flaws(std::span<const ServoSample> log, const ServoFit& fit);

}  // namespace alidade
