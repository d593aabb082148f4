#pragma once

#include <Eigen/Geometry>

#include "alidade/geometry/so3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Rigid motion that maps coordinates in frame a to coordinates in frame b. Name every instance `b_from_a`:
///     point_in_cam   = cam_from_board * point_in_board
///     cam_from_world = cam_from_base * base_from_world      (inner names cancel)
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< Hamilton, unit norm.
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();         ///< [m]

  [[nodiscard]] Rigid3 inverse() const {
    const Eigen::Quaterniond inverse_rotation = rotation.conjugate();
    return {inverse_rotation, -(inverse_rotation * translation)};
  }

  /// T ⊞ ξ = T · Exp(ξ), ξ = [translation, rotation], the perturbation on the right (manif's convention, with the
  /// translation perturbed directly in frame a: T Exp(ξ) ≈ (R Exp(φ), t + R ρ)).
  [[nodiscard]] Rigid3 retract(const Eigen::Vector<double, 6>& xi) const {
    return {(rotation * exp_so3(xi.tail<3>())).normalized(), translation + rotation * xi.head<3>()};
  }
};

[[nodiscard]] inline Eigen::Vector3d operator*(const Rigid3& b_from_a, const Eigen::Vector3d& point_in_a) {
  return b_from_a.rotation * point_in_a + b_from_a.translation;
}

[[nodiscard]] inline Rigid3 operator*(const Rigid3& c_from_b, const Rigid3& b_from_a) {
  return {(c_from_b.rotation * b_from_a.rotation).normalized(), c_from_b * b_from_a.translation};
}

ALIDADE_PUBLIC_END
}  // namespace alidade
