#include "alidade/geometry/so3_jacobian.h"

#include <cmath>

#include "alidade/geometry/so3.h"

namespace alidade {

Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& phi) {
  const double theta2 = phi.squaredNorm(), theta = std::sqrt(theta2);
  // Series where the closed forms lose digits.
  const double a = theta2 < 1e-6 ? 0.5 - theta2 / 24.0 : (1.0 - std::cos(theta)) / theta2;
  const double b = theta2 < 1e-4 ? 1.0 / 6.0 - theta2 / 120.0 : (theta - std::sin(theta)) / (theta2 * theta);
  const Eigen::Matrix3d X = cross_matrix(phi);
  return Eigen::Matrix3d::Identity() - a * X + b * X * X;
}

}  // namespace alidade
