#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Innovation ν = z − h(x) of a measurement before its update, and the covariance S of ν.
struct Innovation {
  Eigen::Vector2d nu = Eigen::Vector2d::Zero();
  Eigen::Matrix2d S = Eigen::Matrix2d::Identity();
  double nis = 0.0;  ///< νᵀ S⁻¹ ν: χ² with 2 degrees of freedom if the models hold.
};

ALIDADE_PUBLIC_END

/// A χ² with `num` degrees of freedom as σ of a normal. If the residuals' own σ was estimated from residuals that
/// include the tested ones, with `num_estimated` degrees of freedom (0: it was given), the χ² is converted to an F. E.
/// Paulson, Ann. Math. Stat. 13, 1942.
[[nodiscard]] inline double score_sigmas(double chi2, double num, double num_estimated) {
  const double left = num_estimated - num;
  const bool is_estimated = left >= 2.0;
  const double F =
      is_estimated ? chi2 / num / (std::max(num_estimated - chi2, 1e-3 * num_estimated) / left) : chi2 / num;
  const double a = 2.0 / (9.0 * num), b = is_estimated ? 2.0 / (9.0 * left) : 0.0, root = std::cbrt(F);
  return std::max(0.0, ((1.0 - b) * root - (1.0 - a)) / std::sqrt(b * root * root + a));
}

/// The quantile of Student's distribution that corresponds to the normal quantile `z` (Abramowitz & Stegun 26.7.5).
[[nodiscard]] inline double students(double z, double dof) {
  return z + (std::pow(z, 3) + z) / (4.0 * dof) +
         (5.0 * std::pow(z, 5) + 16.0 * std::pow(z, 3) + 3.0 * z) / (96.0 * dof * dof);
}
}  // namespace alidade
