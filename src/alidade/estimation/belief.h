#pragma once

#include <Eigen/Core>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A Gaussian over N components: mean x and covariance P.
template <int N>
struct Belief {
  static constexpr int dim = N;
  Eigen::Vector<double, N> x = Eigen::Vector<double, N>::Zero();
  Eigen::Matrix<double, N, N> P = Eigen::Matrix<double, N, N>::Identity();
};

/// Copies the upper triangle to the lower one. Recursions need to compute only the upper triangle correctly.
template <int N>
void mirror_upper(Eigen::Matrix<double, N, N>& P) {
  for (int i = 1; i < N; ++i) {
    for (int j = 0; j < i; ++j) P(i, j) = P(j, i);
  }
}

ALIDADE_PUBLIC_END
}  // namespace alidade
