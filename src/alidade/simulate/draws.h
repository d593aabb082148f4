#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <random>

namespace alidade {

/// Seeded random numbers, identical with every standard library; the distributions of <random> are not.
class Draws {
 public:
  explicit Draws(std::uint64_t seed) : bits_(seed) {}

  /// Uniform in [0, 1), 53 bits.
  [[nodiscard]] double uniform() { return static_cast<double>(bits_() >> 11) * 0x1p-53; }
  [[nodiscard]] double uniform(double low, double high) { return low + (high - low) * uniform(); }

  /// Standard normal. G. Marsaglia & T. A. Bray, "A convenient method for generating normal variables", 1964.
  [[nodiscard]] double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double x, y, s;
    do {
      x = uniform(-1.0, 1.0);
      y = uniform(-1.0, 1.0);
      s = x * x + y * y;
    } while (!(s > 0.0 && s < 1.0));
    const double scale = std::sqrt(-2.0 * std::log(s) / s);
    spare_ = y * scale;
    has_spare_ = true;
    return x * scale;
  }

  [[nodiscard]] Eigen::Vector2d normal2() {
    const double x = normal(), y = normal();  // in this order, whatever the compiler's
    return {x, y};
  }
  [[nodiscard]] Eigen::Vector3d normal3() {
    const double x = normal(), y = normal(), z = normal();
    return {x, y, z};
  }

 private:
  std::mt19937_64 bits_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace alidade
