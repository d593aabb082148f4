#include "alidade/servo/identify/log_times.h"

#include <algorithm>
#include <cmath>

#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

using Eigen::Index;

/// Variance of the rows' time errors, from a regression of r² on the squared rate, and its score.
struct TimeVariance {
  double value = 0.0, score = 0.0;
};
TimeVariance time_variance(const ServoIdentification& result, const Eigen::VectorXd& rate) {
  const auto n = static_cast<Index>(result.residual_rad.size());
  const Eigen::ArrayXd residual = Eigen::Map<const Eigen::ArrayXd>(result.residual_rad.data(), n);
  const Eigen::ArrayXd square = residual.square() - residual.square().mean();
  const Eigen::ArrayXd rate2 = rate.array().square() - rate.array().square().mean();
  const double spread = rate2.square().sum();
  if (!(spread > 0.0) || !(square.square().sum() > 0.0)) return {};
  // The correlation of squared residuals is the square of that of the residuals.
  const double correlation = std::min(
      0.95, std::pow((residual.head(n - 1) * residual.tail(n - 1)).sum(), 2) / std::pow(residual.square().sum(), 2));
  const double slope = (square * rate2).sum() / spread;
  const double sigma = std::sqrt(square.square().mean() / spread * (1.0 + correlation) / (1.0 - correlation));
  return {slope, slope / sigma};
}

/// ∂ rate / ∂ t, by central differences.
Eigen::VectorXd slope_of(std::span<const ServoSample> log, const Eigen::VectorXd& rate) {
  const std::vector<double> times_s = reading_times(log);
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(rate.size());
  for (Index i = 1; i + 1 < rate.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    slope[i] = (rate[i + 1] - rate[i - 1]) / (times_s[at + 1] - times_s[at - 1]);
  }
  return slope;
}

}  // namespace

std::optional<RegularTimes> regular_times(std::span<const ServoSample> log) {
  constexpr double as_written_s = 2e-6, most_off = 1.05,
                   least_of_spacing = 0.02;  // off: total, in steps
  constexpr std::size_t least_rows = 20;
  if (log.size() < least_rows) return std::nullopt;
  const double begin_s = log.front().t_s, spacing_s = usual_spacing(log);
  for (const double step_s : {1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3}) {
    if (step_s > 2.0 * spacing_s || step_s < least_of_spacing * spacing_s) continue;
    const bool is_rounded = std::ranges::all_of(log, [&](const ServoSample& row) {
      return std::abs(std::remainder(row.t_s - begin_s, step_s)) < as_written_s && std::isnan(row.command_t_s);
    });
    if (!is_rounded) continue;
    const auto num = static_cast<Index>(log.size());
    Eigen::VectorXd t_s(num);
    for (Index i = 0; i < num; ++i) t_s[i] = log[static_cast<std::size_t>(i)].t_s;
    const Eigen::VectorXd at =
        Eigen::VectorXd::LinSpaced(num, -0.5 * static_cast<double>(num - 1), 0.5 * static_cast<double>(num - 1));
    const double apart_s = at.dot(t_s) / at.squaredNorm();
    const Eigen::VectorXd line = (apart_s * at).array() + t_s.mean();
    const Eigen::VectorXd off_s = t_s - line;
    const double range_s = off_s.maxCoeff() - off_s.minCoeff();
    if (range_s < 0.2 * step_s || range_s > most_off * step_s) return std::nullopt;
    return RegularTimes{step_s, apart_s, {line.data(), line.data() + num}};
  }
  return std::nullopt;
}

ServoParams by_clock_rate(const ServoFit& fit) {
  ServoParams by = ServoParams::Zero();
  by[ServoParam::tau] = fit.params[ServoParam::tau];
  by[ServoParam::latency] = fit.params[ServoParam::latency];
  if (fit.kind == ServoKind::rate) {
    by[ServoParam::gain] = -fit.params[ServoParam::gain];
    by[ServoParam::start] = -fit.params[ServoParam::start];
  }
  return by;
}

void count_clock_rate(double sigma_clock, ServoFit& fit) {
  const ServoParams moved = sigma_clock * by_clock_rate(fit);
  fit.cov += moved * moved.transpose();
  for (const std::size_t flaw : fit.freed) {
    const bool is_of_time = flaw == ServoFlaw::rate_limit || flaw == ServoFlaw::second_lag ||
                            flaw == ServoFlaw::rate_offset || flaw == ServoFlaw::soft_rate_limit;
    const double power = flaw == ServoFlaw::acceleration_limit        ? 2.0
                         : is_of_time || flaw == ServoFlaw::resonance ? 1.0
                                                                      : 0.0;
    fit.flaw_sigma[flaw] = std::hypot(fit.flaw_sigma[flaw], power * sigma_clock * fit.flaws.*servo_flaws[flaw]);
  }
}

void count_time_stamps(std::span<const ServoSample> log, const Eigen::MatrixXd& J, const Eigen::MatrixXd& inverse,
                       ServoIdentification& result) {
  const Eigen::VectorXd rate = -J.col(ServoParam::latency);
  const TimeVariance variance = time_variance(result, rate);
  if (!(variance.score > sigmas_of_time_stamps)) return;
  result.sigma_time_s = std::sqrt(variance.value);
  result.sigma_time_score = variance.score;
  ServoFit& fit = result.fit;
  const Eigen::VectorXd blur = 0.5 * variance.value * slope_of(log, rate);
  const Eigen::VectorXd follow = inverse * (J.transpose() * blur);
  fit.cov += follow.head<num_servo_params>() * follow.head<num_servo_params>().transpose();
  fit.cov(ServoParam::latency, ServoParam::latency) += 3.0 * variance.value;
  for (std::size_t i = 0; i < fit.freed.size(); ++i) {
    double& sigma = fit.flaw_sigma[fit.freed[i]];
    sigma = std::hypot(sigma, follow[num_servo_params + static_cast<Index>(i)]);
  }
}

}  // namespace alidade
