#pragma once

#include <Eigen/Geometry>
#include <cmath>

namespace alidade {

/// Unit quaternion of a rotation vector [rad]: (cos ½θ, sin(½θ)/θ · φ). Exact at zero.
/// Solà, Deray & Atchuthan, "A micro Lie theory", 2018, eq. (133).
[[nodiscard]] inline Eigen::Quaterniond exp_so3(const Eigen::Vector3d& phi) {
  const double theta2 = phi.squaredNorm();
  const double theta = std::sqrt(theta2);
  const double half_sinc = theta2 < 1e-12 ? 0.5 - theta2 / 48.0 : std::sin(0.5 * theta) / theta;
  return {std::cos(0.5 * theta), half_sinc * phi.x(), half_sinc * phi.y(), half_sinc * phi.z()};
}

/// Rotation vector [rad] of a unit quaternion, with an angle in [0, π]. Inverse of exp_so3().
[[nodiscard]] inline Eigen::Vector3d log_so3(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;  // q and −q are the same rotation: take the short way
  const double sin_half = q.vec().norm();
  const double scale = sin_half < 1e-9 ? 2.0 : 2.0 * std::atan2(sin_half, sign * q.w()) / sin_half;
  return sign * scale * q.vec();
}

/// [v]× with [v]× w = v × w.
[[nodiscard]] inline Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  return (Eigen::Matrix3d() << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0).finished();
}

}  // namespace alidade
