#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace alidade {

/// The median, the upper one for an even number; 0 of none.
template <typename Number>
[[nodiscard]] Number median_of(std::vector<Number> values) {
  if (values.empty()) return Number{};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace alidade
