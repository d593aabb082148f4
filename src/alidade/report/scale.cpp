#include "alidade/report/scale.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace alidade::report {
namespace {

constexpr double slack = 1e-9;  // relative: so that 0.3 counts as a multiple of 0.1

double power_below(double value) { return std::pow(10.0, std::floor(std::log10(value) + slack)); }

}  // namespace

double Scale::operator()(double value) const {
  double share = 0.0;
  if (is_log)
    share = value > 0.0 ? std::log(value / low) / std::log(high / low) : -1.0;
  else
    share = (value - low) / (high - low);
  return from + std::clamp(share, -0.05, 1.05) * (to - from);
}

std::vector<double> linear_ticks(double low, double high, int wanted) {
  std::vector<double> ticks;
  if (!(high > low) || wanted < 1) return ticks;
  const double step = round_up_125((high - low) / wanted);
  const double first = std::ceil(low / step - slack);
  for (int i = 0; i <= 4 * wanted + 4; ++i) {
    const double tick = (first + i) * step;
    if (tick > high + slack * step) break;
    ticks.push_back(std::abs(tick) < slack * step ? 0.0 : tick);
  }
  return ticks;
}

std::vector<double> log_ticks(double low, double high) {
  std::vector<double> ticks;
  if (!(low > 0.0) || !(high >= low)) return ticks;
  for (double power = power_below(low); power <= high * (1.0 + slack); power *= 10.0)
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double tick = power * factor;
      if (tick >= low * (1.0 - slack) && tick <= high * (1.0 + slack)) ticks.push_back(tick);
    }
  return ticks;
}

double round_up_125(double value) {
  if (!(value > 0.0) || !std::isfinite(value)) return 1.0;
  const double power = power_below(value);
  for (const double factor : {1.0, 2.0, 5.0})
    if (value <= power * factor * (1.0 + slack)) return power * factor;
  return 10.0 * power;
}

double round_down_125(double value) {
  if (!(value > 0.0) || !std::isfinite(value)) return 1.0;
  const double power = power_below(value);
  for (const double factor : {5.0, 2.0})
    if (value >= power * factor * (1.0 - slack)) return power * factor;
  return power;
}

double largest_size(const std::vector<double>& values) {
  double largest = 0.0;
  for (const double value : values)
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  return largest;
}

double quantile(std::vector<double> values, double share) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto rank = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(std::min(rank, values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace alidade::report
