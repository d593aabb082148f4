#pragma once

#include <Eigen/Core>
#include <cmath>

namespace alidade {

/// exp(A) by scaling, Taylor series and squaring; exact to rounding for the small matrices of motion models.
template <int N>
[[nodiscard]] Eigen::Matrix<double, N, N> matrix_exponential(const Eigen::Matrix<double, N, N>& A) {
  const double size = A.cwiseAbs().rowwise().sum().maxCoeff();
  const int halvings = size > 0.5 ? static_cast<int>(std::ceil(std::log2(size / 0.5))) : 0;
  const Eigen::Matrix<double, N, N> scaled = A * std::ldexp(1.0, -halvings);
  Eigen::Matrix<double, N, N> sum = Eigen::Matrix<double, N, N>::Identity(), term = sum;
  for (int k = 1; k <= 14; ++k) {  // 0.5¹⁵/15! is 2e-17
    term = (term * scaled / k).eval();
    sum += term;
  }
  for (int k = 0; k < halvings; ++k) sum = (sum * sum).eval();
  return sum;
}

template <int N>
struct Discretised {
  Eigen::Matrix<double, N, N> F, Q;
};

/// F and Q over dt for dx = A x dt + noise of density D: from the exponential of [−A, D; 0, Aᵀ] dt. C. F. Van Loan,
/// "Computing integrals involving the matrix exponential", 1978.
template <int N>
[[nodiscard]] Discretised<N> discretised(const Eigen::Matrix<double, N, N>& A, const Eigen::Matrix<double, N, N>& D,
                                         double dt_s) {
  Eigen::Matrix<double, 2 * N, 2 * N> block = Eigen::Matrix<double, 2 * N, 2 * N>::Zero();
  block.template topLeftCorner<N, N>() = -A * dt_s;
  block.template topRightCorner<N, N>() = D * dt_s;
  block.template bottomRightCorner<N, N>() = A.transpose() * dt_s;
  const Eigen::Matrix<double, 2 * N, 2 * N> phi = matrix_exponential<2 * N>(block);
  Discretised<N> result;
  result.F = phi.template bottomRightCorner<N, N>().transpose();
  const Eigen::Matrix<double, N, N> Q = result.F * phi.template topRightCorner<N, N>();
  result.Q = 0.5 * (Q + Q.transpose());
  return result;
}

}  // namespace alidade
