#pragma once

#include <Eigen/Core>
#include <array>

namespace alidade {

/// ∫ΩΩᵀ dt over the last eight seconds: whether the motion excites what is to be estimated. Kept in bins of a quarter
/// of a second.
class RunningGramian {
 public:
  using Matrix = Eigen::Matrix<double, 8, 8>;

  void add(const Matrix& omega_omega_t, double dt_s);

  /// Least eigenvalue of the first six rows and columns, after what the motion about the axis of view (the last two)
  /// could explain as well is taken out. Small: some of the intrinsics do not show, or hardly.
  [[nodiscard]] double lambda_min() const;

 private:
  static constexpr double bin_s = 0.25;
  std::array<Matrix, 32> bins_ = filled_with_zero();
  std::size_t newest_ = 0;
  double newest_s_ = 0.0;  // length of what is in the newest bin

  static std::array<Matrix, 32> filled_with_zero();
};

}  // namespace alidade
