#include "alidade/servo/loop_analysis.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"
#include "alidade/servo/axis/sampled_axis.h"

namespace alidade {
namespace {

using Complex = std::complex<double>;

constexpr double half_power = 1.0 / std::numbers::sqrt2;

Complex open_loop(const ServoPlant& plant, const PiGains& gains, double omega) {
  const Complex s(0.0, omega);
  const Complex lag = gain_of(plant) / (tau_of(plant) * s + 1.0);
  const Complex G = std::holds_alternative<RatePlant>(plant) ? lag / s : lag;
  return (gains.kp + gains.ki / s) * G;
}

/// Roots of τ s² + (1 + g kp) s + g ki (for a rate plant with one more integration).
std::vector<Complex> poles_of(const ServoPlant& plant, const PiGains& gains) {
  const double g = gain_of(plant);
  std::vector<double> rising{g * gains.ki, g * gains.kp};
  if (std::holds_alternative<RatePlant>(plant))
    rising.push_back(1.0);
  else
    rising[1] += 1.0;
  const auto order = static_cast<Eigen::Index>(rising.size());
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(order, order);
  companion.diagonal(-1).setOnes();
  for (Eigen::Index i = 0; i < order; ++i)
    companion(i, order - 1) = -rising[static_cast<std::size_t>(i)] / tau_of(plant);
  const Eigen::VectorXcd roots = eigenvalues_of(companion);
  std::vector<Complex> poles(roots.data(), roots.data() + roots.size());
  std::ranges::sort(poles, {}, [](const Complex& pole) { return std::pair(pole.real(), pole.imag()); });
  return poles;
}

/// Bisection between two frequencies on different sides of a level.
double where_it_passes(const std::function<double(double)>& size, double level, double low, double high) {
  const bool falls = size(high) < level;
  for (int k = 0; k < 60; ++k) {
    const double middle = std::sqrt(low * high);
    ((size(middle) < level) == falls ? high : low) = middle;
  }
  return low;
}

/// The highest frequency from `lowest` to `highest` at which a magnitude falls below a level; 0 if there is none.
double falls_through(const std::function<double(double)>& size, double level, double lowest, double highest) {
  constexpr int steps = 2000;
  const auto frequency = [&](int i) { return lowest * std::pow(highest / lowest, static_cast<double>(i) / steps); };
  for (int i = steps; i > 0; --i)
    if (size(frequency(i)) < level && size(frequency(i - 1)) >= level)
      return where_it_passes(size, level, frequency(i - 1), frequency(i));
  return 0.0;
}

ContinuousLoop continuous_loop(const ServoPlant& plant, const PiGains& gains) {
  constexpr double lowest = 1e-4, highest = 1e6;
  ContinuousLoop result;
  const auto L = [&](double omega) { return open_loop(plant, gains, omega); };
  result.poles = poles_of(plant, gains);
  result.bandwidth_rad_s =
      falls_through([&](double w) { return std::abs(L(w) / (1.0 + L(w))); }, half_power, lowest, highest);
  result.crossover_rad_s = falls_through([&](double w) { return std::abs(L(w)); }, 1.0, lowest, highest);
  if (result.crossover_rad_s > 0.0)
    result.phase_margin_deg = std::remainder(180.0 + std::arg(L(result.crossover_rad_s)) / degree, 360.0);
  return result;
}

/// The loop at z = exp(jωT), with its whole periods of delay kept separate, whose phase wraps around many times.
class SampledLoop {
 public:
  SampledLoop(const SampledAxis& axis, const PiGains& gains, double period_s, int delay_samples)
      : axis_(axis), gains_(gains), period_s_(period_s), delay_samples_(delay_samples) {}

  [[nodiscard]] Complex without_delay(double omega) const {
    const Complex z = std::polar(1.0, omega * period_s_);
    return (gains_.kp + gains_.ki * period_s_ / (z - 1.0)) * axis_.response(z);
  }
  [[nodiscard]] double delay_phase(double omega) const { return -omega * period_s_ * delay_samples_; }
  [[nodiscard]] Complex operator()(double omega) const {
    return without_delay(omega) * std::polar(1.0, delay_phase(omega));
  }

 private:
  SampledAxis axis_;
  PiGains gains_;
  double period_s_;
  int delay_samples_;
};

/// Bandwidth, and the smallest phase margin of all crossovers; the phase is unwrapped from low frequencies on, where it
/// is between −360° and 0.
void add_margins(const SampledLoop& loop, double period_s, LoopAnalysis& result) {
  constexpr int steps = 2000;
  const double lowest = 1e-7 / period_s, highest = std::numbers::pi / period_s;
  const auto size = [&](double w) { return std::abs(loop.without_delay(w)); };
  result.bandwidth_rad_s =
      falls_through([&](double w) { return std::abs(loop(w) / (1.0 + loop(w))); }, half_power, lowest, highest);
  double before = lowest, size_before = size(before), phase = std::arg(loop.without_delay(before));
  if (phase > 1e-6) phase -= 2.0 * std::numbers::pi;
  for (int i = 1; i <= steps; ++i) {
    const double omega = lowest * std::pow(highest / lowest, static_cast<double>(i) / steps), size_now = size(omega);
    if ((size_now < 1.0) != (size_before < 1.0)) {
      const double crossover = where_it_passes(size, 1.0, before, omega);
      const double turned = std::remainder(std::arg(loop.without_delay(crossover)) - phase, 2.0 * std::numbers::pi);
      const double margin_deg = 180.0 + (phase + turned + loop.delay_phase(crossover)) / degree;
      if (!(result.crossover_rad_s > 0.0) || margin_deg < result.phase_margin_deg) {
        result.crossover_rad_s = crossover;
        result.phase_margin_deg = margin_deg;
      }
    }
    phase += std::remainder(std::arg(loop.without_delay(omega)) - phase, 2.0 * std::numbers::pi);
    before = omega;
    size_before = size_now;
  }
}

/// State: angle, rate, lagged command, integral, last command,
/// delayed errors (newest first). Only the sum of the delays matters.
double sampled_radius(const SampledAxis& axis, const PiGains& gains, double period_s, int delay_samples) {
  constexpr Eigen::Index integral = 3, last = 4, first_error = 5;
  const Eigen::Index size = first_error + delay_samples;
  Eigen::MatrixXd next = Eigen::MatrixXd::Zero(size, size);
  Eigen::RowVectorXd error = Eigen::RowVectorXd::Zero(size);  // as the controller receives it
  if (delay_samples == 0)
    error[0] = -1.0;
  else
    error[size - 1] = 1.0;
  Eigen::RowVectorXd command = gains.kp * error;
  command[integral] += gains.ki;
  next.topLeftCorner<3, 3>() = axis.A;
  next.topRows<3>() += axis.now * command;
  next.topRows<3>().col(last) += axis.before;
  next.row(integral) = period_s * error;
  next(integral, integral) += 1.0;
  next.row(last) = command;
  if (delay_samples > 0) next(first_error, 0) = -1.0;
  for (Eigen::Index i = first_error + 1; i < size; ++i) next(i, i - 1) = 1.0;
  return eigenvalues_of(next).cwiseAbs().maxCoeff();
}

}  // namespace

PiGains PiGains::per_rad(double focal_px) const {
  const double units = unit == ErrorUnit::px ? focal_px : unit == ErrorUnit::deg ? 180.0 / std::numbers::pi : 1.0;
  return {kp * units, ki * units, ErrorUnit::rad};
}

LoopAnalysis analysed(const ServoAxis& axis, const PiGains& per_rad, double period_s, int delay_samples) {
  LoopAnalysis result;
  const SampledAxis sampled = sampled_with_delay(axis, period_s);
  const int all_samples = delay_samples + sampled.delay_samples;
  result.continuous = continuous_loop(axis.plant, per_rad);
  add_margins(SampledLoop(sampled, per_rad, period_s, all_samples), period_s, result);
  result.sampled_radius = sampled_radius(sampled, per_rad, period_s, all_samples);
  return result;
}

LoopAnalysis analysed(const ServoPlant& plant, const PiGains& per_rad, double period_s, int delay_samples) {
  ServoAxis axis;
  axis.plant = plant;
  return analysed(axis, per_rad, period_s, delay_samples);
}

}  // namespace alidade
