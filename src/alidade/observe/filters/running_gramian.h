#pragma once

#include <Eigen/Core>
#include <array>

namespace alidade {

/// ∫ΩΩᵀ dt over the last eight seconds: whether the motion excites the parameters to be estimated. Stored in bins of a
/// quarter of a second.
class RunningGramian {
 public:
  using Matrix = Eigen::Matrix<double, 8, 8>;

  void add(const Matrix& omega_omega_t, double dt_s);

  /// Smallest eigenvalue of the first six rows and columns after elimination of what the motion about the optical
  /// axis (the last two) could explain as well. If it is small, some of the intrinsics are poorly observable.
  [[nodiscard]] double lambda_min() const;

 private:
  static constexpr double bin_s = 0.25;
  std::array<Matrix, 32> bins_ = filled_with_zero();
  std::size_t newest_ = 0;
  double newest_s_ = 0.0;  // duration covered by the newest bin

  static std::array<Matrix, 32> filled_with_zero();
};

}  // namespace alidade
