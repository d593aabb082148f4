#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "alidade/geometry/decompositions.h"
#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/log_times.h"

// A time constant that the log determines only in part, though it determines the answer.

namespace alidade {

bool is_lagged_otherwise(const ServoFit& fit) {
  return std::ranges::any_of(fit.freed, [](std::size_t flaw) {
    return flaw == ServoFlaw::acceleration_limit || flaw == ServoFlaw::resonance;
  });
}

bool is_hardly_excited(const ServoFit& fit) {
  constexpr double clear = 3.0;
  return std::ranges::count(fit.freed, std::size_t{ServoFlaw::resonance}) > 0 &&
         std::abs(fit.flaws.resonance_share) < clear * fit.flaw_sigma[ServoFlaw::resonance_share];
}

void count_short_lag(std::span<const ServoSample> log, ServoFit& fit) {
  if (is_hardly_excited(fit)) {
    const double per_omega = fit.flaws.resonance_damping / (std::numbers::pi * fit.flaws.resonance_hz);
    fit.cov(ServoParam::latency, ServoParam::latency) += std::pow(per_omega * fit.flaws.resonance_share, 2);
  }
  const double tau_s = fit.params[ServoParam::tau];
  if (!is_lagged_otherwise(fit) || tau_s > usual_spacing(log)) return;
  ServoParams by = ServoParams::Zero();
  by[ServoParam::tau] = tau_s;
  by[ServoParam::latency] = -tau_s;
  fit.cov += by * by.transpose();
}

Eigen::MatrixXd with_open_lag(std::span<const ServoSample> log, const ServoFit& fit, Eigen::MatrixXd J) {
  using Eigen::Index;
  constexpr double shows = 2.0, short_rows = 0.5;  // in σ of a reading; in row intervals
  constexpr std::array<double, 7> widths{0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 0.98};
  const double tau_s = fit.params[ServoParam::tau], spacing_s = usual_spacing(log);
  const auto lag = std::ranges::find(fit.freed, std::size_t{ServoFlaw::second_lag});
  const bool is_split = lag != fit.freed.end();
  if (!is_split && !(is_lagged_otherwise(fit) && tau_s < short_rows * spacing_s)) return J;
  Eigen::MatrixXd others(J.rows(), J.cols() - 1);
  others << J.leftCols(ServoParam::tau), J.rightCols(J.cols() - ServoParam::tau - 1);
  const Eigen::MatrixXd across = orthonormal_basis(others, others.cols());
  const auto left = [&](const Eigen::VectorXd& by) { return (by - across * (across.transpose() * by)).norm(); };
  const double most_s = is_split ? fit.flaws.second_tau_s : 4.0 * spacing_s;
  if (left(J.col(ServoParam::tau)) * widths[2] * most_s > shows * fit.rms_rad) return J;
  const Eigen::VectorXd response = flawed_response(log, fit, fit.flaws);
  Eigen::VectorXd slope = J.col(ServoParam::tau);
  for (const double width : widths) {
    ServoFit wider = fit;
    wider.params[ServoParam::tau] += width * most_s;
    if (is_split) wider.flaws.second_tau_s -= width * most_s;
    slope = (flawed_response(log, wider, wider.flaws) - response) / (width * most_s);
    if (left(slope) * width * most_s > shows * fit.rms_rad) break;
  }
  J.col(ServoParam::tau) = slope;
  if (is_split) J.col(ServoParam::tau) += J.col(num_servo_params + (lag - fit.freed.begin()));
  return J;
}

}  // namespace alidade
