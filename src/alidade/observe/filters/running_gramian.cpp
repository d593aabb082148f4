#include "alidade/observe/filters/running_gramian.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace alidade {

std::array<RunningGramian::Matrix, 32> RunningGramian::filled_with_zero() {
  std::array<Matrix, 32> bins;
  bins.fill(Matrix::Zero());
  return bins;
}

void RunningGramian::add(const Matrix& omega_omega_t, double dt_s) {
  bins_[newest_] += dt_s * omega_omega_t;
  newest_s_ += dt_s;
  for (std::size_t i = 0; newest_s_ >= bin_s - 1e-9 && i < bins_.size(); ++i) {
    newest_ = (newest_ + 1) % bins_.size();
    newest_s_ -= bin_s;
    bins_[newest_].setZero();
  }
  newest_s_ = std::min(newest_s_, bin_s);  // after a step longer than all bins
}

double RunningGramian::lambda_min() const {
  Matrix sum = Matrix::Zero();
  for (const Matrix& bin : bins_) sum += bin;
  Eigen::Matrix<double, 6, 6> reduced = sum.topLeftCorner<6, 6>();
  for (Eigen::Index i = 6; i < 8; ++i) {  // the two are uncoupled: one acts on x, the other on y
    if (sum(i, i) > 0.0) reduced -= sum.block<6, 1>(0, i) * sum.block<1, 6>(i, 0) / sum(i, i);
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(reduced, Eigen::EigenvaluesOnly);
  return std::max(0.0, eigen.eigenvalues()[0]);
}

}  // namespace alidade
