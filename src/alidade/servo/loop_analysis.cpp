#include "alidade/servo/loop_analysis.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "alidade/geometry/decompositions.h"
#include "alidade/servo/axis/axis_model.h"

namespace alidade {
namespace {

using Complex = std::complex<double>;

Complex open_loop(const ServoPlant& plant, const PiGains& gains, double omega) {
  const Complex s(0.0, omega);
  const Complex lag = gain_of(plant) / (tau_of(plant) * s + 1.0);
  const Complex G = std::holds_alternative<RatePlant>(plant) ? lag / s : lag;
  return (gains.kp + gains.ki / s) * G;
}

/// Roots of τ s² + (1 + g kp) s + g ki (of a rate plant: one more integration).
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

/// The highest frequency at which a size falls through a level; 0 where it never does.
double falls_through(const std::function<double(double)>& size, double level) {
  constexpr double lowest = 1e-4, highest = 1e6;
  constexpr int steps = 2000;
  const auto frequency = [](int i) { return lowest * std::pow(highest / lowest, static_cast<double>(i) / steps); };
  for (int i = steps; i > 0; --i) {
    if (!(size(frequency(i)) < level && size(frequency(i - 1)) >= level)) continue;
    double low = frequency(i - 1), high = frequency(i);
    for (int k = 0; k < 60; ++k) {
      const double middle = std::sqrt(low * high);
      (size(middle) < level ? high : low) = middle;
    }
    return low;
  }
  return 0.0;
}

/// State: angle, rate, integral, errors on their way (newest first).
double sampled_radius(const ServoPlant& plant, const PiGains& gains, double period_s, int delay_samples) {
  const AxisModel model = sampled(plant, period_s);
  const Eigen::Index size = 3 + delay_samples;
  Eigen::MatrixXd next = Eigen::MatrixXd::Zero(size, size);
  Eigen::RowVectorXd error = Eigen::RowVectorXd::Zero(size);  // as the controller sees it
  if (delay_samples == 0)
    error[0] = -1.0;
  else
    error[size - 1] = 1.0;
  Eigen::RowVectorXd command = gains.kp * error;
  command[2] += gains.ki;
  next.topLeftCorner<2, 2>() = model.A;
  next.topRows<2>() += model.B * command;
  next.row(2) = period_s * error;
  next(2, 2) += 1.0;
  if (delay_samples > 0) next(3, 0) = -1.0;
  for (Eigen::Index i = 4; i < size; ++i) next(i, i - 1) = 1.0;
  return eigenvalues_of(next).cwiseAbs().maxCoeff();
}

}  // namespace

PiGains PiGains::per_rad(double focal_px) const {
  const double units = unit == ErrorUnit::px ? focal_px : unit == ErrorUnit::deg ? 180.0 / std::numbers::pi : 1.0;
  return {kp * units, ki * units, ErrorUnit::rad};
}

LoopAnalysis analysed(const ServoPlant& plant, const PiGains& per_rad, double period_s, int delay_samples) {
  LoopAnalysis result;
  const auto L = [&](double omega) { return open_loop(plant, per_rad, omega); };
  result.poles = poles_of(plant, per_rad);
  result.bandwidth_rad_s =
      falls_through([&](double w) { return std::abs(L(w) / (1.0 + L(w))); }, 1.0 / std::numbers::sqrt2);
  result.crossover_rad_s = falls_through([&](double w) { return std::abs(L(w)); }, 1.0);
  if (result.crossover_rad_s > 0.0)
    result.phase_margin_deg =
        std::remainder(180.0 + std::arg(L(result.crossover_rad_s)) * 180.0 / std::numbers::pi, 360.0);
  result.sampled_radius = sampled_radius(plant, per_rad, period_s, delay_samples);
  return result;
}

}  // namespace alidade
