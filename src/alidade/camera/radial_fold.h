#pragma once

#include <span>

namespace alidade::detail {

/// Smallest t > 0 with p(t) = 1 + c[0] t + c[1] t² + … = 0, at most 4 coefficients; infinity where there is none.
/// With t = r² this is where a radial map r (1 + …) stops growing. 0 if a coefficient is not finite.
[[nodiscard]] double first_root(std::span<const double> c);

/// True if p has no root in (0, t] for certain, judged by its negative terms alone. Cheap; may be false without need.
[[nodiscard]] inline bool is_surely_positive(std::span<const double> c, double t) {
  double bound = 1.0, power = 1.0;
  for (const double coefficient : c) {
    power *= t;
    if (coefficient < 0.0) bound += coefficient * power;
  }
  return bound > 0.0 && power < 1e300;
}

}  // namespace alidade::detail
