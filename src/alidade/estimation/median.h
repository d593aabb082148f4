#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace alidade {

/// The middle value by size, the larger of two; 0 of none.
template <typename Number>
[[nodiscard]] Number median_of(std::vector<Number> values) {
  if (values.empty()) return Number{};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace alidade
