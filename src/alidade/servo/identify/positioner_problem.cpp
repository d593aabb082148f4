#include "alidade/servo/identify/positioner_problem.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/servo/identify/levenberg.h"

namespace alidade {
namespace {

constexpr double clock_sigma_s = 2e-4;  // between a program and the clock of the device

/// Removes repeated readings at rest: they have the same rounding error, and the first ones contain everything.
std::vector<PositionerReading> without_rests(const std::vector<PositionerReading>& all) {
  constexpr int kept_at_rest = 2;
  std::vector<PositionerReading> some;
  int still = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    still = i > 0 && all[i].angle_rad == all[i - 1].angle_rad ? still + 1 : 0;
    const bool moves_next = i + 1 < all.size() && all[i + 1].angle_rad != all[i].angle_rad;
    if (still < kept_at_rest || moves_next) some.push_back(all[i]);
  }
  return some;
}

/// Number of equal consecutive readings for each reading: they share one rounding error.
std::vector<double> shared_roundings(const std::vector<PositionerReading>& readings) {
  std::vector<double> shared(readings.size(), 1.0);
  for (std::size_t i = 0, j = 0; i < readings.size(); i = j) {
    while (j < readings.size() && readings[j].angle_rad == readings[i].angle_rad) ++j;
    std::fill(shared.begin() + static_cast<std::ptrdiff_t>(i), shared.begin() + static_cast<std::ptrdiff_t>(j),
              static_cast<double>(j - i));
  }
  return shared;
}

}  // namespace

PositionerParams positioner_params(const PositionerVector& theta, double dead_band_rad) {
  using P = PositionerPlace;
  return {.rate_rad_s = std::exp(theta[P::rate]),
          .acceleration_rad_s2 = std::exp(theta[P::acceleration]),
          .time_constant_s = std::exp(theta[P::time_constant]),
          .latency_s = std::max(0.0, theta[P::latency]),
          .backlash_rad = std::max(0.0, theta[P::backlash]),
          .dead_band_rad = dead_band_rad};
}

PositionerProblem::PositionerProblem(const PositionerLog& log, double step_rad, double dead_band_rad)
    : commands_(log.commands), dead_band_rad_(dead_band_rad), step_rad_(step_rad) {
  origin_s_ = log.readings.front().t_s;
  for (PositionCommand& command : commands_) command.t_s -= origin_s_;
  start_rad_ = log.readings.front().angle_rad;
  std::vector<PositionerReading> within;
  for (PositionerReading reading : log.readings) {
    if (reading.t_s < log.used_from_s || reading.t_s > log.used_until_s) continue;
    reading.t_s -= origin_s_;
    within.push_back(reading);
  }
  readings_ = without_rests(within);
  const std::size_t n = readings_.size();
  shared_ = shared_roundings(readings_);
  for (std::size_t i = 0; i < n; ++i) {
    const PositionerReading &before = readings_[i > 0 ? i - 1 : 0], &after = readings_[std::min(i + 1, n - 1)];
    const double dt = after.t_s - before.t_s;
    rate_.push_back(dt > 0.0 ? (after.angle_rad - before.angle_rad) / dt : 0.0);
    const double timing = rate_.back() * std::hypot(readings_[i].wait_s / std::sqrt(12.0), clock_sigma_s);
    sigma_.push_back(std::max(1e-7, std::hypot(step_rad * std::sqrt(shared_[i] / 12.0), timing)));
    times_.push_back(readings_[i].t_s);
    const auto later = std::ranges::upper_bound(commands_, readings_[i].t_s, {}, &PositionCommand::t_s);
    move_.push_back(static_cast<int>(later - commands_.begin()));
  }
}

std::vector<double> PositionerProblem::response(const PositionerVector& theta, const std::vector<double>& times) const {
  const double offset = theta[PositionerPlace::offset];
  std::vector<double> angles =
      positioner_response(positioner_params(theta, dead_band_rad_), start_rad_ - offset, commands_, times);
  for (double& angle : angles) angle += offset;
  return angles;
}

/// Sampling times for another period, about the middle of the log, so that a common shift belongs to the latency.
std::vector<double> PositionerProblem::sampled_times(double sampling) const {
  std::vector<double> times = times_;
  for (double& time : times) time += sampling * (time - middle_s());
  return times;
}

std::vector<double> PositionerProblem::model(const PositionerVector& theta) const {
  return response(theta, sampled_times(theta[PositionerPlace::sampling]));
}

Eigen::VectorXd PositionerProblem::misfit(const PositionerVector& theta) const {
  const std::vector<double> angles = model(theta);
  Eigen::VectorXd misfit(static_cast<Eigen::Index>(angles.size()));
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double z = (angles[i] - readings_[i].angle_rad) / sigma_[i];
    misfit[static_cast<Eigen::Index>(i)] = robust_residual(z, threshold_);
  }
  return misfit;
}

Eigen::MatrixXd PositionerProblem::jacobian(const PositionerVector& theta, const std::vector<int>& free) const {
  static const PositionerVector steps = (PositionerVector() << 2e-3, 1e-2, 1e-2, 5e-4, 2e-4, 1e-4, 1e-5).finished();
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(size()), PositionerPlace::count);
  for (const int place : free) {
    PositionerVector low = theta, high = theta;
    low[place] -= steps[place];
    high[place] += steps[place];
    if (place == PositionerPlace::latency || place == PositionerPlace::backlash) low[place] = std::max(0.0, low[place]);
    J.col(place) = (misfit(high) - misfit(low)) / (high[place] - low[place]);
  }
  return J;
}

double PositionerProblem::solve(PositionerVector& theta, const std::vector<int>& free, int max_steps) const {
  using P = PositionerPlace;
  const auto after = [](const PositionerVector& from, Eigen::VectorXd step) {
    step.head<3>() = step.head<3>().cwiseMax(-0.7).cwiseMin(0.7);
    PositionerVector next = from + step;
    next[P::latency] = std::max(0.0, next[P::latency]);
    next[P::backlash] = std::max(0.0, next[P::backlash]);
    next[P::time_constant] = std::clamp(next[P::time_constant], std::log(1e-3), std::log(5.0));
    next[P::acceleration] = std::clamp(next[P::acceleration], std::log(1e-3), std::log(3e3));
    return next;
  };
  const LevenbergConfig config{.max_steps = max_steps, .first_damping = 1e-3, .tolerance = 1e-5, .ridge = 1e-16};
  return levenberg(
             config, theta, [&](const PositionerVector& at) { return misfit(at); },
             [&](const PositionerVector& at, const Eigen::VectorXd&) { return jacobian(at, free); }, after)
      .sum2;
}

AxisReadings PositionerProblem::axis_readings(const PositionerVector& theta) const {
  AxisReadings all{{}, {}, sigma_, [this, theta](const std::vector<double>& times) { return response(theta, times); }};
  for (const PositionerReading& reading : readings_) {
    all.t_s.push_back(reading.t_s);
    all.angle_rad.push_back(reading.angle_rad);
  }
  return all;
}

std::optional<EncoderSampling> PositionerProblem::find_sampling(const PositionerVector& theta) const {
  return found_sampling(axis_readings(theta));
}

EncoderSampling PositionerProblem::refined(const EncoderSampling& sampling, PositionerVector& theta) const {
  const EncoderSampling better = refined_sampling(axis_readings(theta), sampling);
  const double shift_s = better.phase_s - sampling.last_s(better.phase_s);
  theta[PositionerPlace::latency] =
      std::max(0.0, theta[PositionerPlace::latency] +
                        (shift_s < 0.5 * sampling.period_s ? shift_s : shift_s - sampling.period_s));
  return better;
}

EncoderSampling PositionerProblem::fitted(const EncoderSampling& sampling, const PositionerVector& theta) const {
  const double by = theta[PositionerPlace::sampling];
  return {sampling.period_s * (1.0 + by), sampling.phase_s + by * (sampling.phase_s - middle_s())};
}

void PositionerProblem::set_sampling(const EncoderSampling& sampling, const PositionerVector& theta) {
  std::vector<double> edges_s;
  for (const PositionerReading& reading : readings_) edges_s.push_back(0.5 * reading.wait_s);
  times_ = sample_times(axis_readings(theta), sampling, edges_s);
  // The time of the request does not matter any more, only that of the sample.
  for (std::size_t i = 0; i < size(); ++i)
    sigma_[i] = std::max(1e-7, std::hypot(step_rad_ * std::sqrt(shared_[i] / 12.0), rate_[i] * 0.25 * clock_sigma_s));
}

}  // namespace alidade
