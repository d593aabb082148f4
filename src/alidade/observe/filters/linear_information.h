#pragma once

#include <Eigen/Cholesky>

namespace alidade {

/// Information on unknown constants x from linear measurements, z = βᵀx + noise of variance s: the estimate
/// and the inverse of its covariance. One frame consists of begin(), add() for each scalar, finish(). Scalars
/// of one frame may be correlated if each comes with its variance given those before it. Allocates nothing.
template <int n>
class LinearInformation {
 public:
  using Vector = Eigen::Matrix<double, n, 1>;
  using Matrix = Eigen::Matrix<double, n, n>;

  LinearInformation(const Vector& mean, const Matrix& information)
      : mean_(mean), information_(information), factor_(information) {
    begin();
  }

  void begin() {
    gradient_.setZero();
    chi2_ = 0.0;
    num_scalars_ = 0;
  }

  void add(const Vector& beta, double z, double s) {
    const double innovation = z - beta.dot(mean_);
    information_.template selfadjointView<Eigen::Lower>().rankUpdate(beta, 1.0 / s);
    gradient_ += (innovation / s) * beta;
    chi2_ += innovation * innovation / s;
    ++num_scalars_;
  }

  void finish() {
    factor_.compute(information_);
    const Vector step = factor_.solve(gradient_);
    mean_ += step;
    chi2_ -= gradient_.dot(step);
  }

  [[nodiscard]] const Vector& mean() const { return mean_; }
  /// The full matrix, not only one triangle.
  [[nodiscard]] Matrix information() const { return information_.template selfadjointView<Eigen::Lower>(); }
  /// Diagonal of J Σ Jᵀ; valid after finish().
  template <int m>
  [[nodiscard]] Eigen::Matrix<double, m, 1> variances(const Eigen::Matrix<double, m, n>& j) const {
    return (j * factor_.solve(j.transpose())).diagonal();
  }
  /// Normalised innovation squared of the frame, and its number of scalars.
  [[nodiscard]] double nis() const { return chi2_; }
  [[nodiscard]] int num_scalars() const { return num_scalars_; }

 private:
  Vector mean_;
  Matrix information_;  // lower triangle
  Eigen::LDLT<Matrix> factor_;
  Vector gradient_;
  double chi2_ = 0.0;
  int num_scalars_ = 0;
};

}  // namespace alidade
