#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

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

/// The shortest rotation that takes one direction into another; of opposite ones any, by π. Eigen's FromTwoVectors says
/// the same, and takes seconds to compile wherever it is used: it holds a singular value decomposition.
[[nodiscard]] inline Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized(), b = to.normalized();
  const double cos_angle = a.dot(b);
  Eigen::Vector3d axis = a.cross(b);
  if (cos_angle > 0.0) return Eigen::Quaterniond(1.0 + cos_angle, axis.x(), axis.y(), axis.z()).normalized();
  const double sin2 = axis.squaredNorm();
  if (sin2 == 0.0) axis = a.unitOrthogonal();
  const Eigen::Vector3d along = (b - a).normalized();  // rounding tilts a short axis: it is at right angles to this
  axis -= along.dot(axis) * along;
  const double w = sin2 / (1.0 - cos_angle);  // 1 + cos, without cancellation
  return Eigen::Quaterniond(w, axis.x(), axis.y(), axis.z()).normalized();
}

ALIDADE_PUBLIC_END
}  // namespace alidade
