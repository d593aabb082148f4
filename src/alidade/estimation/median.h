#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace alidade {

/// The median; for an even number of values the upper one; 0 for none.
template <typename Number>
[[nodiscard]] Number median_of(std::vector<Number> values) {
  if (values.empty()) return Number{};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// σ of a normal distribution over its median absolute deviation: 1/Φ⁻¹(3/4). F. R. Hampel, JASA 69, 1974.
inline constexpr double normal_from_mad = 1.4826;
/// Median length of a vector of two unit normal coordinates (Rayleigh distribution): √(2 ln 2).
inline constexpr double rayleigh_median = 1.1774100225154747;

}  // namespace alidade
