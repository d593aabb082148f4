#pragma once

#include <string>
#include <vector>

namespace alidade::report {

/// Maps values to places on the paper, linearly or by their logarithm. Bounds are values, `from`/`to` places.
struct Scale {
  double low = 0.0, high = 1.0;
  double from = 0.0, to = 1.0;
  bool is_log = false;

  [[nodiscard]] double operator()(double value) const;  ///< Clamped to a little outside the bounds.
  [[nodiscard]] bool holds(double value) const { return value >= low && value <= high; }
};

/// Round values within [low, high], about `wanted` of them: 1, 2 or 5 times a power of ten apart.
[[nodiscard]] std::vector<double> linear_ticks(double low, double high, int wanted);

/// 1, 2 and 5 times each power of ten within [low, high].
[[nodiscard]] std::vector<double> log_ticks(double low, double high);

/// The smallest of 1, 2, 5 × 10ⁿ that is not below `value`; 1 if value is not positive. So that reports share scales.
[[nodiscard]] double round_up_125(double value);
[[nodiscard]] double round_down_125(double value);

/// Largest finite absolute value, 0 if there is none.
[[nodiscard]] double largest_size(const std::vector<double>& values);

/// The value below which the share `share` of the finite values lies, NaN if there is none.
[[nodiscard]] double quantile(std::vector<double> values, double share);

}  // namespace alidade::report
