#include "alidade/servo/identify/positioner_problem.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/servo/identify/levenberg.h"

namespace alidade {
namespace {

constexpr double clock_sigma_s = 2e-4;  // between a program and the device's own clock

/// At rest the same rounding error is read repeatedly: the first readings contain everything.
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

/// How many readings in a row are the same: they share one rounding error.
std::vector<double> shared_roundings(const std::vector<PositionerReading>& readings) {
  std::vector<double> shared(readings.size(), 1.0);
  for (std::size_t i = 0, j = 0; i < readings.size(); i = j) {
    while (j < readings.size() && readings[j].angle_rad == readings[i].angle_rad) ++j;
    std::fill(shared.begin() + static_cast<std::ptrdiff_t>(i), shared.begin() + static_cast<std::ptrdiff_t>(j),
              static_cast<double>(j - i));
  }
  return shared;
}

/// Of Fourier's first harmonic in what is left, by frequency.
struct Harmonic {
  double power = 0.0, cosine = 0.0, sine = 0.0;
};
Harmonic harmonic_of(const std::vector<Eigen::Vector3d>& late, double hz) {  // (t, e, weight)
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double sum = 0.0, sum_e = 0.0, sum_ee = 0.0;
  for (const Eigen::Vector3d& each : late) {
    const double phase = 2.0 * std::numbers::pi * hz * each[0];
    const Eigen::Vector3d row(1.0, std::cos(phase), std::sin(phase));
    normal += each[2] * row * row.transpose();
    right += each[2] * each[1] * row;
    sum += each[2];
    sum_e += each[2] * each[1];
    sum_ee += each[2] * each[1] * each[1];
  }
  const Eigen::Vector3d x = solve_symmetric(normal, right);
  const double before = sum_ee - sum_e * sum_e / sum, after = sum_ee - x.dot(right);
  return {before / std::max(after, 1e-12) - 1.0, x[1], x[2]};
}

/// Squares that a sawtooth of this period and phase leaves of the times by which readings are late.
double sawtooth_cost(const std::vector<Eigen::Vector3d>& late, double period, double phase) {
  double sum = 0.0, sum_e = 0.0, sum_ee = 0.0;
  for (const Eigen::Vector3d& each : late) {
    const double cycles = (each[0] - phase) / period;
    const double e = each[1] - period * (cycles - std::floor(cycles));
    sum += each[2];
    sum_e += each[2] * e;
    sum_ee += each[2] * e * e;
  }
  return sum_ee - sum_e * sum_e / sum;
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

std::vector<double> PositionerProblem::model(const PositionerVector& theta) const { return response(theta, times_); }

Eigen::VectorXd PositionerProblem::misfit(const PositionerVector& theta) const {
  constexpr double bend = 4.0;
  const std::vector<double> angles = model(theta);
  Eigen::VectorXd misfit(static_cast<Eigen::Index>(angles.size()));
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double z = (angles[i] - readings_[i].angle_rad) / sigma_[i], size = std::abs(z);
    misfit[static_cast<Eigen::Index>(i)] =
        size <= bend ? z : std::copysign(bend * std::sqrt(1.0 + 2.0 * std::log(size / bend)), z);
  }
  return misfit;
}

Eigen::MatrixXd PositionerProblem::jacobian(const PositionerVector& theta, const std::vector<int>& free) const {
  static const PositionerVector steps = (PositionerVector() << 2e-3, 1e-2, 1e-2, 5e-4, 2e-4, 1e-4).finished();
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
             [&](const PositionerVector& at) { return jacobian(at, free); }, after)
      .sum2;
}

bool PositionerProblem::find_sampling(const PositionerVector& theta, double& period_s, double& phase_s) const {
  constexpr double slowest_hz = 3.0, fastest_hz = 120.0, min_gain = 0.5;
  const std::vector<double> angles = response(theta, times_);
  std::vector<Eigen::Vector3d> late;
  for (std::size_t i = 0; i < size(); ++i) {
    if (std::abs(rate_[i]) < 1.0 * degree || std::abs(rate_[i]) * 0.02 < 2.0 * sigma_[i]) continue;
    const double e = (angles[i] - readings_[i].angle_rad) / rate_[i], sigma = sigma_[i] / std::abs(rate_[i]) + 1e-3;
    if (std::abs(e) < 0.4) late.emplace_back(readings_[i].t_s, e, 1.0 / (sigma * sigma));
  }
  if (late.size() < 60) return false;
  const double step_hz = 0.2 / (late.back()[0] - late.front()[0] + 1.0);
  double best = 0.0, best_hz = 0.0;
  for (double hz = slowest_hz; hz < fastest_hz; hz += step_hz) {
    const double power = harmonic_of(late, hz).power;
    if (power > best) {
      best = power;
      best_hz = hz;
    }
  }
  if (best < min_gain) return false;
  const Harmonic found = harmonic_of(late, best_hz);
  const double amplitude = std::hypot(found.cosine, found.sine) * std::numbers::pi * best_hz;  // 1 of a full sawtooth
  if (amplitude < 0.5 || amplitude > 1.6) return false;
  double least = 1e300;
  for (int i = -12; i <= 12; ++i) {
    const double period = 1.0 / (best_hz + step_hz * i / 6.0);
    for (int k = 0; k < 100; ++k) {
      const double phase = period * k / 100.0, cost = sawtooth_cost(late, period, phase);
      if (cost >= least) continue;
      least = cost;
      period_s = period;
      phase_s = phase;
    }
  }
  return least < 0.5 * sawtooth_cost(late, 1e-9, 0.0);
}

void PositionerProblem::set_sampling(double period_s, double phase_s, const PositionerVector& theta) {
  constexpr double edge_s = 1.5e-3;
  std::vector<double> other(size());
  for (std::size_t i = 0; i < size(); ++i) {
    const double t = readings_[i].t_s, cycle = std::floor((t - phase_s) / period_s);
    times_[i] = phase_s + cycle * period_s;
    const double into = t - times_[i], edge = edge_s + 0.5 * readings_[i].wait_s;
    other[i] = into < edge ? times_[i] - period_s : period_s - into < edge ? times_[i] + period_s : times_[i];
  }
  const std::vector<double> first = response(theta, times_);
  std::vector<double> sorted = other;
  std::vector<std::size_t> order(size());
  for (std::size_t i = 0; i < size(); ++i) order[i] = i;
  std::ranges::sort(order, {}, [&](std::size_t i) { return other[i]; });
  std::ranges::sort(sorted);
  const std::vector<double> second = response(theta, sorted);
  for (std::size_t i = 0; i < size(); ++i) {
    const std::size_t at = order[i];
    if (std::abs(second[i] - readings_[at].angle_rad) < std::abs(first[at] - readings_[at].angle_rad))
      times_[at] = other[at];
  }
  for (std::size_t i = 1; i < size(); ++i) times_[i] = std::max(times_[i], times_[i - 1]);
  // When it was asked no longer counts, only when it was sampled.
  for (std::size_t i = 0; i < size(); ++i)
    sigma_[i] = std::max(1e-7, std::hypot(step_rad_ * std::sqrt(shared_[i] / 12.0), rate_[i] * 0.25 * clock_sigma_s));
}

}  // namespace alidade
