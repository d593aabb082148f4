#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace alidade {

/// Weights of values at four different times whose sum leaves no polynomial of degree two; their squares sum to one.
/// Noise that is the same at each time has its σ in the sum.
[[nodiscard]] inline std::array<double, 4> third_difference(const std::array<double, 4>& times) {
  std::array<double, 4> weights{};
  double squares = 0.0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    weights[i] = 1.0;
    for (std::size_t j = 0; j < times.size(); ++j)
      if (j != i) weights[i] /= times[i] - times[j];
    squares += weights[i] * weights[i];
  }
  for (double& weight : weights) weight /= std::sqrt(squares);
  return weights;
}

}  // namespace alidade
