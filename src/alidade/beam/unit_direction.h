#pragma once

#include <Eigen/Geometry>
#include <cmath>

namespace alidade {

/// Orthonormal basis T (3×2) of the plane perpendicular to a unit vector, right-handed with it. At +z it is (x, y).
[[nodiscard]] inline Eigen::Matrix<double, 3, 2> tangent_basis(const Eigen::Vector3d& direction) {
  // The axis that is least along the direction, but x wherever it will do, so that the basis changes seldom.
  const Eigen::Vector3d axis = std::abs(direction.x()) < 0.9 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  Eigen::Matrix<double, 3, 2> T;
  T.col(0) = (axis - axis.dot(direction) * direction).normalized();
  T.col(1) = direction.cross(T.col(0));
  return T;
}

/// A ⊞ δ = normalise(A + T δ), δ [rad] to first order.
[[nodiscard]] inline Eigen::Vector3d retract_direction(const Eigen::Vector3d& direction, const Eigen::Vector2d& delta) {
  return (direction + tangent_basis(direction) * delta).normalized();
}

}  // namespace alidade
