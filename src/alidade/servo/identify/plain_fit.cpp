#include "alidade/servo/identify/identify_flaws.h"

#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/servo/identify/levenberg.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

ServoParams unit_params(double tau_s, double latency_s) {
  ServoParams params;
  params << 1.0, tau_s, latency_s, 0.0, 0.0;
  return params;
}

/// Response to commands of one sign: the change of the response for a gain that differs by sign.
Eigen::VectorXd rectified_response(std::span<const ServoSample> log, ServoKind kind, double tau_s, double latency_s) {
  std::vector<ServoSample> rows(log.begin(), log.end());
  for (ServoSample& row : rows) row.command = std::abs(row.command);
  return servo_response(rows, kind, unit_params(tau_s, latency_s)).J.col(ServoParam::gain);
}

LinearFit fit_of(const Eigen::MatrixXd& A, const Eigen::VectorXd& readings, double tau_s, double latency_s) {
  const Eigen::VectorXd best = least_squares(A, readings);
  LinearFit fit;
  fit.params << best[0], tau_s, latency_s, best[1], best[2];
  if (A.cols() > 3 && best[0] != 0.0) fit.difference = best[3] / best[0];
  fit.sum2 = (A * best - readings).squaredNorm();
  return fit;
}

/// Columns of gain, zero and start, in which the response is linear.
Eigen::MatrixXd linear_part(std::span<const ServoSample> log, ServoKind kind, double tau_s, double latency_s) {
  const ServoResponse response = servo_response(log, kind, unit_params(tau_s, latency_s));
  Eigen::MatrixXd A(response.J.rows(), 3);
  A << response.J.col(ServoParam::gain), response.J.col(ServoParam::zero), response.J.col(ServoParam::start);
  return A;
}

Eigen::MatrixXd with_column(Eigen::MatrixXd A, const Eigen::VectorXd& column) {
  A.conservativeResize(Eigen::NoChange, A.cols() + 1);
  A.rightCols<1>() = column;
  return A;
}

}  // namespace

std::vector<ServoSample> thinned(std::span<const ServoSample> log) {
  constexpr std::size_t most = 1500;
  const std::size_t stride = (log.size() + most - 1) / most;
  std::vector<ServoSample> rows;
  for (std::size_t i = 0; i < log.size(); ++i)
    if (i % stride == 0 || log[i].command != log[i - 1].command) rows.push_back(log[i]);
  return rows;
}

LinearFit searched(std::span<const ServoSample> log, ServoKind kind, bool by_sign) {
  constexpr double clearly = 0.1;
  const std::vector<ServoSample> rows = thinned(log);
  const Eigen::VectorXd readings = readings_of(rows);
  const std::vector<double> times_s = reading_times(rows);
  const Eigen::VectorXd at_s = Eigen::Map<const Eigen::VectorXd>(times_s.data(), readings.size());
  const double duration_s = log.back().t_s - log.front().t_s;
  const double step_s = duration_s / static_cast<double>(log.size() - 1);
  std::vector<double> latencies{0.0};
  for (double late_s = 0.5 * step_s; late_s < duration_s / 3.0; late_s *= 1.4) latencies.push_back(late_s);
  LinearFit best, turning;
  const auto keep_better = [](LinearFit& kept, const LinearFit& tried) {
    if (tried.sum2 < kept.sum2) kept = tried;
  };
  for (double tau_s = 0.3 * step_s; tau_s < 3.0 * duration_s; tau_s *= 1.6) {
    for (const double latency_s : latencies) {
      Eigen::MatrixXd A = linear_part(rows, kind, tau_s, latency_s);
      if (by_sign) A = with_column(std::move(A), rectified_response(rows, kind, tau_s, latency_s));
      keep_better(best, fit_of(A, readings, tau_s, latency_s));
      if (kind != ServoKind::rate || by_sign) continue;
      keep_better(turning, fit_of(with_column(std::move(A), at_s), readings, tau_s, latency_s));
    }
  }
  // For a rate plant, a drift independent of its command may hide all other effects.
  if (turning.sum2 < clearly * best.sum2) return turning;
  return best;
}

std::optional<Eigen::MatrixXd> inverse_normal(const Eigen::MatrixXd& J) {
  const Eigen::MatrixXd JtJ = J.transpose() * J;
  const Eigen::VectorXd scale = JtJ.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * JtJ * scale.asDiagonal();
  const Ldlt ldlt(scaled);
  if (!(ldlt.min_pivot() > 1e-10)) return std::nullopt;
  return scale.asDiagonal() * ldlt.inverse() * scale.asDiagonal();
}

ServoFit refined(std::span<const ServoSample> log, ServoKind kind, ServoParams params) {
  const Eigen::VectorXd readings = readings_of(log);
  const double dof = static_cast<double>(readings.size()) - num_servo_params;
  // 5 to 15 steps are typical; a kink at a sampled latency takes more
  const LevenbergOutcome descent = levenberg(
      {.max_steps = 60, .first_damping = 1e-6, .tolerance = 1e-12}, params,
      [&](const ServoParams& at) -> Eigen::VectorXd { return servo_response(log, kind, at).angle_rad - readings; },
      [&](const ServoParams& at, const Eigen::VectorXd&) { return servo_response(log, kind, at).J; },
      [](const ServoParams& from, const auto& step) { return within_meaning(from, ServoParams(from + step)); });
  ServoFit fit;
  fit.kind = kind;
  fit.has_converged = descent.has_converged;
  fit.params = params;
  fit.rms_rad = std::sqrt(descent.sum2 / dof);
  const auto inverse = inverse_normal(servo_response(log, kind, params).J);
  fit.is_observable = inverse.has_value();
  if (inverse) fit.cov = fit.cov_model = fit.rms_rad * fit.rms_rad * *inverse;
  return fit;
}

double log_determinant(const Eigen::MatrixXd& A) {
  const Eigen::VectorXd scale = A.diagonal().cwiseSqrt().cwiseMax(1e-300);
  const Eigen::VectorXd down = scale.cwiseInverse();
  const Eigen::VectorXd pivots = Ldlt(scaled_by(down, A)).pivots();
  return pivots.array().max(1e-300).log().sum() + 2.0 * scale.array().log().sum();
}

}  // namespace alidade
