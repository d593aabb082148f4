#include "alidade/servo/identify/identify_flaws.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"
#include "alidade/servo/identify/levenberg.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

using Eigen::Index;

constexpr double gain_unit = 0.05, max_gain_change = 0.9;  ///< Size of a unit step, and the largest.
constexpr double offset_unit_rad_s = 0.01;
constexpr double clock_unit = 0.01, max_clock_rate = 0.1;  ///< Size of a unit step; a larger rate is not a clock error.
constexpr double min_damping = 5e-3, max_damping = 0.98;   ///< Range of the resonance's damping.

/// Size of a unit step of a flaw: flaws with a single sign change by factors.
double unit_of(const ServoFit& fit, std::size_t flaw) {
  constexpr double turn_rad = 0.1;
  if (flaw == ServoFlaw::clock_rate) return clock_unit;
  if (is_of_the_gain(flaw)) return gain_unit;
  if (flaw == ServoFlaw::resonance_share) return 1.0;
  if (flaw == ServoFlaw::rate_offset) return offset_unit_rad_s;
  if (flaw == ServoFlaw::earlier_command) return turn_rad / std::max(std::abs(fit.params[ServoParam::gain]), 1e-300);
  return fit.flaws.*servo_flaws[flaw];
}

bool is_linear(std::size_t flaw) {
  return flaw == ServoFlaw::earlier_command || flaw == ServoFlaw::resonance_share || flaw == ServoFlaw::rate_offset;
}

/// The fit after a step of one parameter or freed flaw.
ServoFit moved(const ServoFit& fit, Index param, double by) {
  ServoFit next = fit;
  if (param < num_servo_params) {
    next.params[param] += by;
    next.params = within_meaning(fit.params, next.params);
  } else {
    const std::size_t flaw = fit.freed[static_cast<std::size_t>(param - num_servo_params)];
    double& size = next.flaws.*servo_flaws[flaw];
    if (is_linear(flaw)) {  // the response is linear in it
      size += by * unit_of(fit, flaw);
      return next;
    }
    const double most = flaw == ServoFlaw::resonance ? 0.1 : 1.0;
    by = std::clamp(by, -most, most);
    if (flaw == ServoFlaw::clock_rate)
      size = std::clamp(size + clock_unit * by, -max_clock_rate, max_clock_rate);
    else if (is_of_the_gain(flaw))
      size = std::clamp(size + gain_unit * by, -max_gain_change, max_gain_change);
    else
      size *= std::exp(by);
    if (flaw == ServoFlaw::resonance_damping) size = std::clamp(size, min_damping, max_damping);
    // By convention the second of two lags is the shorter one.
    if (flaw == ServoFlaw::second_lag)
      size = std::clamp(size, 0.02 * next.params[ServoParam::tau], next.params[ServoParam::tau]);
  }
  return next;
}

/// Whether a positive step leaves a flaw unchanged, at the upper end of its range.
bool is_at_upper_end(const ServoFit& fit, Index param) {
  if (param < num_servo_params) return false;
  const double ServoFlaws::*size = servo_flaws[fit.freed[static_cast<std::size_t>(param - num_servo_params)]];
  return moved(fit, param, 1e-4).flaws.*size == fit.flaws.*size;
}

/// Step of a parameter for numerical differentiation.
double step_of(std::span<const ServoSample> log, const ServoFit& fit, Index param) {
  const double spacing_s = (log.back().t_s - log.front().t_s) / static_cast<double>(log.size());
  switch (param) {
    case ServoParam::gain:
      return 1e-5 * std::abs(fit.params[ServoParam::gain]);
    case ServoParam::tau:
      return 1e-4 * fit.params[ServoParam::tau];
    case ServoParam::latency:
      return std::min(1e-3 * std::max(fit.params[ServoParam::tau], spacing_s), 0.01 * spacing_s);
    case ServoParam::zero:
    case ServoParam::start:
      return 1e-6;
    default:
      return 1e-4;
  }
}

/// ∂ response / ∂ (parameters, freed flaws in their own units), by central differences.
Eigen::MatrixXd jacobian_by_factors(std::span<const ServoSample> log, const ServoFit& fit) {
  const auto num = static_cast<Index>(num_servo_params + fit.freed.size());
  Eigen::MatrixXd J(readings_of(log).size(), num);
  for (Index k = 0; k < num; ++k) {
    if (k == ServoParam::zero) {
      J.col(k).setOnes();
      continue;
    }
    const double step = step_of(log, fit, k);
    const bool is_at_edge = k == ServoParam::latency && fit.params[ServoParam::latency] < step;
    const ServoFit more = moved(fit, k, step), less = moved(fit, k, is_at_edge ? 0.0 : -step);
    J.col(k) = (flawed_response(log, more, more.flaws) - flawed_response(log, less, less.flaws)) /
               (is_at_edge ? step : 2.0 * step);
  }
  return J;
}

/// The same by one-sided differences from a known misfit: half the cost, for the steps of a descent.
Eigen::MatrixXd jacobian_of_steps(std::span<const ServoSample> log, const Eigen::VectorXd& readings,
                                  const ServoFit& fit, const Eigen::VectorXd& misfit) {
  const auto num = static_cast<Index>(num_servo_params + fit.freed.size());
  const Eigen::VectorXd here = misfit + readings;
  Eigen::MatrixXd J(readings.size(), num);
  for (Index k = 0; k < num; ++k) {
    if (k == ServoParam::zero) {
      J.col(k).setOnes();
      continue;
    }
    const double step = is_at_upper_end(fit, k) ? -step_of(log, fit, k) : step_of(log, fit, k);
    const ServoFit there = moved(fit, k, step);
    J.col(k) = (flawed_response(log, there, there.flaws) - here) / step;
  }
  return J;
}

double max_rate(std::span<const ServoSample> log, const Eigen::VectorXd& response) {
  const std::vector<double> times_s = reading_times(log);
  double most = 0.0;
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    const auto at = static_cast<Index>(i);
    most = std::max(most, std::abs(response[at] - response[at - 1]) / (times_s[i] - times_s[i - 1]));
  }
  return most;
}

std::vector<double> sizes_of(std::span<const ServoSample> log, const ServoFit& fit, const Eigen::VectorXd& response,
                             std::size_t flaw) {
  const auto times = [](double unit, std::initializer_list<double> factors) {
    std::vector<double> sizes;
    for (const double factor : factors) sizes.push_back(unit * factor);
    return sizes;
  };
  switch (flaw) {
    case ServoFlaw::rate_limit:
      return times(max_rate(log, response), {0.99, 0.95, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2, 0.1});
    case ServoFlaw::acceleration_limit:
      return times(max_rate(log, response) / fit.params[ServoParam::tau], {0.9, 0.7, 0.5, 0.3, 0.15});
    case ServoFlaw::dead_band:
      return times(largest_command(log), {0.005, 0.01, 0.02, 0.05, 0.1, 0.2});
    case ServoFlaw::backlash:
      return times(response.maxCoeff() - response.minCoeff(), {0.002, 0.005, 0.01, 0.02, 0.05, 0.1});
    case ServoFlaw::clock_rate:  // accumulates to a fraction of the time constant
      return times(fit.params[ServoParam::tau] / (log.back().t_s - log.front().t_s), {-0.2, -0.02, 0.02, 0.2});
    case ServoFlaw::earlier_command:
      return times(largest_command(log), {-1.0, 1.0});
    case ServoFlaw::gain_difference:
    case ServoFlaw::gain_drift:
    case ServoFlaw::gain_by_size:  // the response is nearly linear in them
      return times(gain_unit, {-1.0, 1.0});
    case ServoFlaw::command_limit:
      return times(largest_command(log), {0.98, 0.9, 0.8, 0.65, 0.5, 0.3});
    case ServoFlaw::rate_offset:
      return times(offset_unit_rad_s, {-1.0, 1.0});
    case ServoFlaw::soft_rate_limit:
      return times(max_rate(log, response), {0.5, 1.0, 2.0, 5.0, 20.0, 100.0});
    default:
      return times(fit.params[ServoParam::tau], {0.1, 0.3, 0.6, 1.0});
  }
}

}  // namespace

Eigen::VectorXd flawed_misfit(std::span<const ServoSample> log, const ServoFit& fit) {
  return flawed_response(log, fit, fit.flaws) - readings_of(log);
}

double refine_flawed(std::span<const ServoSample> log, int max_steps, ServoFit& fit) {
  const auto after = [](const ServoFit& from, const Eigen::VectorXd& step) {
    ServoFit next = from;
    for (Index k = 0; k < step.size(); ++k) next = moved(next, k, step[k]);
    return next;
  };
  const Eigen::VectorXd readings = readings_of(log);
  const LevenbergOutcome descent = levenberg(
      {.max_steps = max_steps, .first_damping = 1e-4, .tolerance = 1e-9, .ridge = 1e-18}, fit,
      [&](const ServoFit& at) -> Eigen::VectorXd { return flawed_response(log, at, at.flaws) - readings; },
      [&](const ServoFit& at, const Eigen::VectorXd& misfit) { return jacobian_of_steps(log, readings, at, misfit); },
      after);
  fit.has_converged = descent.has_converged;
  const double dof = static_cast<double>(readings.size()) - num_servo_params - static_cast<double>(fit.freed.size());
  fit.rms_rad = std::sqrt(descent.sum2 / std::max(1.0, dof));
  return descent.sum2;
}

Eigen::MatrixXd flawed_jacobian(std::span<const ServoSample> log, const ServoFit& fit) {
  Eigen::MatrixXd J = jacobian_by_factors(log, fit);
  for (std::size_t i = 0; i < fit.freed.size(); ++i)
    J.col(num_servo_params + static_cast<Index>(i)) /= unit_of(fit, fit.freed[i]);
  return J;
}

FlawGround flaw_ground(std::span<const ServoSample> log, const ServoFit& fit) {
  const Eigen::MatrixXd J = jacobian_by_factors(log, fit);
  FlawGround ground{flawed_response(log, fit, fit.flaws), {}, orthonormal_basis(J, J.cols())};
  ground.misfit = flawed_misfit(log, fit);
  return ground;
}

std::vector<FlawScore> flaw_scores(std::span<const ServoSample> log, const ServoFit& fit, const FlawGround& ground,
                                   std::size_t flaw) {
  std::vector<FlawScore> scores;
  if (!is_of_kind(fit.kind, flaw)) return {{}};
  for (const double size : sizes_of(log, fit, ground.response, flaw)) {
    ServoFlaws flaws = fit.flaws;
    flaws.*servo_flaws[flaw] = size;
    Eigen::VectorXd added = flawed_response(log, fit, flaws) - ground.response;
    added -= ground.across * (ground.across.transpose() * added);  // projects out the parameters
    const double own2 = added.squaredNorm(), along = -added.dot(ground.misfit);
    // Only for the sign of the flaw, and zero if the parameters can reproduce nearly all of its effect.
    const bool shows = own2 > 1e-3 * fit.rms_rad * fit.rms_rad && along > 0.0;
    scores.push_back({size, shows ? along * along / own2 : 0.0});
  }
  std::ranges::stable_sort(scores, std::ranges::greater{}, &FlawScore::gain2);
  return scores;
}

std::vector<HiddenFlaw> hidden_flaws(std::span<const ServoSample> log, const ServoFit& fit) {
  constexpr double share = 0.05, min_evidence = 9.0, min_moved = 0.005;
  const Eigen::VectorXd response = flawed_response(log, fit, fit.flaws);
  const double sum2 = flawed_misfit(log, fit).squaredNorm(), range = response.maxCoeff() - response.minCoeff();
  std::vector<HiddenFlaw> hidden;
  const auto ask = [&](std::size_t flaw, double size) {
    if (std::ranges::count(fit.freed, flaw) > 0 || !(size > 0.0)) return;
    ServoFit trial = fit;
    trial.flaws.*servo_flaws[flaw] = size;
    if (flaw == ServoFlaw::rate_limit && fit.kind == ServoKind::rate) trial.params[ServoParam::gain] *= 1.0 + share;
    const double with2 = refine_flawed(log, 40, trial);
    const double rows = effective_rows(flawed_misfit(log, trial));
    const double factor = trial.params[ServoParam::gain] / fit.params[ServoParam::gain];
    if (rows * std::log(with2 / sum2) < min_evidence && std::abs(factor - 1.0) > min_moved)
      hidden.push_back({flaw, size, factor});
  };
  ask(ServoFlaw::dead_band, share * largest_command(log));
  ask(ServoFlaw::backlash, 0.5 * share * range);
  if (fit.kind == ServoKind::rate) ask(ServoFlaw::rate_limit, max_rate(log, response));
  return hidden;
}

}  // namespace alidade
