#pragma once

#include <algorithm>
#include <vector>

namespace alidade {

/// The value in the middle; of an even count the upper one. Of at least one value.
[[nodiscard]] inline double median(std::vector<double> values) {
  const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), half, values.end());
  return *half;
}

}  // namespace alidade
