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
    resonance,  ///< Its frequency; the next two belong to it.
    resonance_damping,
    resonance_share
  };
};

/// Gain, zero and start that fit best for a time constant and latency, and the remaining misfit.
struct LinearFit {
  ServoParams params = ServoParams::Zero();
  double difference = 0.0;  ///< Of the gain, by the sign of the command.
  double sum2 = std::numeric_limits<double>::infinity();
};

/// Every n-th row, to keep a search over a long log short; commands in between are piecewise constant.
[[nodiscard]] std::vector<ServoSample> thinned(std::span<const ServoSample> log);

/// The best of a grid in time constant (geometric) and latency (up to a third of the log). `by_sign`: with a gain that
/// differs by the sign of the command.
[[nodiscard]] LinearFit searched(std::span<const ServoSample> log, ServoKind kind, bool by_sign = false);

/// (JᵀJ)⁻¹, with the parameters scaled to be independent of units; none if singular.
[[nodiscard]] std::optional<Eigen::MatrixXd> inverse_normal(const Eigen::MatrixXd& J);

/// ln |A|, with the columns scaled to be independent of units.
[[nodiscard]] double log_determinant(const Eigen::MatrixXd& A);

/// Levenberg–Marquardt from there; time constant and latency stay within a meaningful range.
[[nodiscard]] ServoFit refined(std::span<const ServoSample> log, ServoKind kind, ServoParams params);

inline constexpr std::size_t num_of_a_resonance = 3;

/// Of the gain, relative: the response is nearly linear in them.
[[nodiscard]] constexpr bool is_of_the_gain(std::size_t flaw) {
  return flaw == ServoFlaw::gain_difference || flaw == ServoFlaw::gain_drift || flaw == ServoFlaw::gain_by_size;
}

/// Whether a plant of this kind can have it as a separate nonlinearity: for the other kind it is another one, or none.
[[nodiscard]] constexpr bool is_of_kind(ServoKind kind, std::size_t flaw) {
  if (flaw == ServoFlaw::command_limit) return kind == ServoKind::angle;
  return flaw != ServoFlaw::rate_offset || kind == ServoKind::rate;
}

/// Of the log, not of the axis.
[[nodiscard]] constexpr bool is_of_the_log(std::size_t flaw) {
  return flaw == ServoFlaw::clock_rate || flaw == ServoFlaw::earlier_command;
}

/// Largest absolute command.
[[nodiscard]] double largest_command(std::span<const ServoSample> log);

/// Angles that a servo with this fit and its nonlinearities reads at the times of the log. In closed form, except for a
/// second lag, which is integrated in steps.
[[nodiscard]] Eigen::VectorXd flawed_response(std::span<const ServoSample> log, const ServoFit& fit,
                                              const ServoFlaws& flaws);

/// ∂ response / ∂ (parameters in order, freed nonlinearities), by differences.
[[nodiscard]] Eigen::MatrixXd flawed_jacobian(std::span<const ServoSample> log, const ServoFit& fit);

/// The Jacobian if, to first order, the response hardly depends on a time constant far below the rows' spacing,
/// besides a resonance or an acceleration limit, or on how two equal lags are split: the column of the time
/// constant is then a difference wide enough to be visible.
[[nodiscard]] Eigen::MatrixXd with_open_lag(std::span<const ServoSample> log, const ServoFit& fit, Eigen::MatrixXd J);

/// Includes in the covariance that such a time constant below the rows' spacing may equally be a latency.
void count_short_lag(std::span<const ServoSample> log, ServoFit& fit);

/// Whether the lag belongs to an acceleration limit or a resonance, so that the axis needs no other.
[[nodiscard]] bool is_lagged_otherwise(const ServoFit& fit);

/// Whether it has a resonance whose share is within 3σ of zero: how much of the latency is its delay 2ζ/ω is then
/// undetermined (`count_short_lag` includes all of it).
[[nodiscard]] bool is_hardly_excited(const ServoFit& fit);

/// Response − readings.
[[nodiscard]] Eigen::VectorXd flawed_misfit(std::span<const ServoSample> log, const ServoFit& fit);

/// Levenberg–Marquardt over parameters and freed nonlinearities. Returns the sum of squared residuals.
double refine_flawed(std::span<const ServoSample> log, int max_steps, ServoFit& fit);

/// Lag-one autocorrelation.
[[nodiscard]] double lag_one_correlation(const Eigen::VectorXd& misfit);

/// Number of rows with independent errors: for AR(1) noise with the residuals' lag-one correlation.
[[nodiscard]] double effective_rows(const Eigen::VectorXd& misfit);

/// Residuals of a fit, and the directions in which its parameters can follow.
struct FlawGround {
  Eigen::VectorXd response, misfit;  ///< misfit = response − readings.
  Eigen::MatrixXd across;            ///< Orthonormal basis of the Jacobian's columns.
};
[[nodiscard]] FlawGround flaw_ground(std::span<const ServoSample> log, const ServoFit& fit);

/// Part of Σ misfit² that a nonlinearity of one size explains, by one linearisation with the parameters following.
struct FlawScore {
  double size = 0.0, gain2 = 0.0;
};
/// Of a few sizes, the one that explains most comes first.
[[nodiscard]] std::vector<FlawScore> flaw_scores(std::span<const ServoSample> log, const ServoFit& fit,
                                                 const FlawGround& ground, std::size_t flaw);

/// Contribution of a resonance with that damping and a share of one to a response: one column per frequency of a grid
/// up to what the readings resolve.
struct AddedResonances {
  std::vector<double> hz;
  Eigen::MatrixXd added;
};
[[nodiscard]] AddedResonances added_resonances(std::span<const ServoSample> log, const Eigen::VectorXd& response,
                                               double damping);

/// Threshold above which a log indicates a resonance: for a correct model, the largest score over the grid exceeds it
/// less than once in a thousand.
inline constexpr double sigmas_of_a_resonance = 4.5;

/// A resonance of given frequency and damping, its share by one linearisation with the parameters following.
struct ResonanceScore {
  double hz = 0.0, damping = 0.0, share = 0.0;
  double sigmas = 0.0;  ///< Its score, with neighbouring rows correlated as the remaining residuals are.
};

/// The largest score over a grid of frequencies, up to what the readings resolve, and damping ratios. The variance of
/// the score is for errors correlated like the residuals (Bartlett's window). W. K. Newey & K. D. West, "A simple,
/// positive semi-definite, heteroskedasticity and autocorrelation consistent covariance matrix", 1987.
/// `others`: other effects that may be present, each of any size, without a resonance.
[[nodiscard]] ResonanceScore resonance_score(std::span<const ServoSample> log, const ServoFit& fit, FlawGround ground,
                                             std::span<const ServoFlaws> others = {});

/// Whether there is one, besides whatever else the residuals of the fit indicate and the fit does not contain.
[[nodiscard]] bool asks_for_resonance(std::span<const ServoSample> log, const ServoFit& fit);

/// The fit with a resonance freed, from the best points of a grid in its frequency and damping, and in the time
/// constant and latency, which have absorbed its delay without it. None if the best fit does not oscillate.
[[nodiscard]] std::optional<ServoFit> with_resonance(std::span<const ServoSample> log, const ServoFit& fit);

/// Which nonlinearities to try: all if the residuals of a linear fit indicate one of the axis, else those of the log
/// only. Never a resonance: it is tried after all others.
[[nodiscard]] std::vector<std::size_t> indicated_flaws(std::span<const ServoSample> log, const ServoFit& fit);

/// The fit with every one of these nonlinearities that the log supports, one after another: 2 ln of the likelihood
/// ratio, counted in rows with independent errors, above ln n + 12 (Schwarz's criterion, and a margin for the choice
/// among kinds and sizes). For an angle plant the limits of rate and acceleration are also tried jointly, if one alone
/// leaves structure. `rivals`: nonlinearities that explain nearly as much. G. Schwarz, "Estimating the dimension of a
/// model", 1978.
[[nodiscard]] ServoFit with_flaws(std::span<const ServoSample> log, const ServoFit& start,
                                  std::span<const std::size_t> flaws, std::vector<ServoRival>& rivals);

/// Dead band, backlash and a rate limit, each of typical size, that the log would not show: with it the rest
/// fits equally well.
[[nodiscard]] std::vector<HiddenFlaw> hidden_flaws(std::span<const ServoSample> log, const ServoFit& fit);

}  // namespace alidade
