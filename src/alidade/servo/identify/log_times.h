#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "alidade/servo/identify/identify.h"

namespace alidade {

/// Sensitivity of the parameters to the rate of a log's clock, which a log cannot reveal: all its times scale with it.
[[nodiscard]] ServoParams by_clock_rate(const ServoFit& fit);

/// Includes an error of that rate in the covariance of parameters and freed nonlinearities.
void count_clock_rate(double sigma_clock, ServoFit& fit);

/// Threshold of the score above which rows' times are said to have errors.
inline constexpr double sigmas_of_time_stamps = 3.0;

/// Time errors make the residuals' variance grow with the square of the rate: a score test of that, and the effect of
/// such times on the covariance, besides noise. Their mean acts as a latency, of their σ times √3 if readings
/// are never early; and they blur the response, by half of their variance times its second derivative.
/// R. Koenker, "A note on studentizing a test for heteroscedasticity", 1981.
void count_time_stamps(std::span<const ServoSample> log, const Eigen::MatrixXd& J, const Eigen::MatrixXd& inverse,
                       ServoIdentification& result);

/// The times of rows that arrived at a regular spacing and were rounded to multiples of a step.
struct RegularTimes {
  double step_s = 0.0, spacing_s = 0.0;
  std::vector<double> t_s;  ///< Before rounding: none is further than the rounding from the line through them.
};
/// None: times are not such multiples, are regular as they are, or are not regular.
[[nodiscard]] std::optional<RegularTimes> regular_times(std::span<const ServoSample> log);

/// Median interval between rows.
[[nodiscard]] double usual_spacing(std::span<const ServoSample> log);

/// A log with commands that were given before their rows: between rows, or at a row that was lost.
struct CommandTimes {
  ServoFit fit;                       ///< Of the plain model, with these times.
  std::vector<double> given_t_s;      ///< ServoSample::command_t_s of each row; NaN: at the row's time.
  std::size_t num = 0;                ///< Number of estimated times.
  decltype(ServoFit::cov) cov_added;  ///< Additional covariance of the parameters.
  double evidence = 0.0;              ///< 2 ln of the likelihood ratio, with the times marginalised.
  double sigma_offset_s = 0.0;        ///< σ of a common lead of all command times.
};
/// Time at which each changed command was given, uniformly distributed since the previous row (or the first lost row
/// there) and estimated together with the parameters; none if the evidence is not above 12, or there are more
/// than 60. A log does not show the phase of commands between rows: all of them may be up to a row earlier.
[[nodiscard]] std::optional<CommandTimes> command_times(std::span<const ServoSample> log, const ServoFit& fit);

/// Commands at a regular spacing that is not a multiple of the rows' drift relative to their rows: a
/// drift of clocks, as far as the log shows. The σ of their common lead, if the drift of the clocks over the
/// log is within a row (and 3σ); 0 if it is not, or the log has the commands' times.
[[nodiscard]] double sigma_of_drifting_commands(std::span<const ServoSample> log, const ServoFit& fit);

}  // namespace alidade
