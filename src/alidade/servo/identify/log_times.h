#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "alidade/servo/identify/identify.h"

namespace alidade {

/// How the parameters follow the rate of a log's clock: a log cannot show it, since all of its times go with it.
[[nodiscard]] ServoParams by_clock_rate(const ServoFit& fit);

/// Includes an error of that rate in the covariance of parameters and freed flaws.
void count_clock_rate(double sigma_clock, ServoFit& fit);

/// From which score on rows' times are said to err.
inline constexpr double sigmas_of_time_stamps = 3.0;

/// Times that err make the residuals' variance grow with the square of the rate: a score test of that, and what such
/// times do beside noise in the covariance. Their mean is another latency, of the size of their σ times √3 if readings
/// are never early; and they blur the response, by half of their variance times its second derivative.
/// R. Koenker, "A note on studentizing a test for heteroscedasticity", 1981.
void count_time_stamps(std::span<const ServoSample> log, const Eigen::MatrixXd& J, const Eigen::MatrixXd& inverse,
                       ServoIdentification& result);

/// The times of rows that came at a regular spacing and were rounded to whole multiples of a step.
struct RegularTimes {
  double step_s = 0.0, spacing_s = 0.0;
  std::vector<double> t_s;  ///< As they were: from the line through them none is further than a rounding.
};
/// None: times are no such multiples, regular as they are, or not regular.
[[nodiscard]] std::optional<RegularTimes> regular_times(std::span<const ServoSample> log);

/// The median of the times from row to row.
[[nodiscard]] double usual_spacing(std::span<const ServoSample> log);

/// A log of commands that were given before their rows: between rows, or at one that was lost.
struct CommandTimes {
  ServoFit fit;                       ///< Of the plain model, with them.
  std::vector<double> given_t_s;      ///< ServoSample::command_t_s of each row; NaN: at the row.
  std::size_t num = 0;                ///< Of times that were estimated.
  decltype(ServoFit::cov) cov_added;  ///< What they leave open of the parameters.
  double evidence = 0.0;              ///< 2 ln of the likelihood ratio, with the times integrated over.
  double sigma_offset_s = 0.0;        ///< Of what all commands together may have been given earlier.
};
/// When each command that changes was given, evenly distributed since the row before it (or since the first of the rows
/// that were lost there) and estimated with the parameters; none where the evidence is not above 12, or there are more
/// than 60. How commands lie between rows a log does not show: all of them may be up to a row earlier.
[[nodiscard]] std::optional<CommandTimes> command_times(std::span<const ServoSample> log, const ServoFit& fit);

/// Commands at a regular spacing that is no multiple of the rows' lie a little further from their rows each time: a
/// drift of clocks, as far as the log goes. The σ of what they were all given earlier, if the clocks' drift through the
/// log is within a row (and 3σ); 0 where it is not, or the log has the commands' times.
[[nodiscard]] double sigma_of_drifting_commands(std::span<const ServoSample> log, const ServoFit& fit);

}  // namespace alidade
