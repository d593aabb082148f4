#pragma once

#include <span>

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

}  // namespace alidade
