#pragma once

#include <Eigen/Core>
#include <span>

#include "alidade/localize/filter/feature.h"

// Without known points the rotation of the world about its origin is unobservable: camera, velocity and map may all
// rotate together. An EKF, linearised at its changing estimate, violates that: the unobservable direction differs from
// one update to the next, and so it gains spurious information (S. J. Julier & J.
// K. Uhlmann, "A Counter Example to the Theory of SLAM", ICRA 2001). So errors are defined as in the right-invariant
// filter (A. Barrau & S. Bonnabel, "An EKF-SLAM Algorithm with Consistency Properties", 2015): with the rotation ξ = R̂
// δθ of the world, G = exp(ξ), and the error δ of a position p̂,
//     p = G (p̂ + δ + p̂ × ξ)        for the camera, its velocity, points, and anchors of inverse depths,
// which to first order is p̂ + δ. Observations are functions of the bracket only: the position before the world
// rotates. Once the state has moved to p̂′ = Ĝ (…), errors are re-referenced to it: with J the left Jacobian of ξ̂ and
// the new ε_ξ = J ξ, δ′ = Ĝ (δ + p̂ × ξ) − p̂′ × ε_ξ.
//
// This is linear for small rotations only: with a large one, as at a start or after a gap, a camera that rotates in
// place would have to move by ½ ξ² p̂. Such an update moves positions by δ only, and preserves the frame through its
// Jacobians: those with respect to the rotation are corrected by the effect of the rotation on p̂′ − p̂, so that they
// match the covariance, whose errors refer to p̂.

namespace alidade {

/// The rotation of the world that corresponds to a right rotation error of the camera.
class WorldRotation {
 public:
  WorldRotation(const Rigid3& world_from_cam, const Eigen::Vector3d& rotation_error);

  /// p̂ + δ + p̂ × ξ, the bracket above.
  [[nodiscard]] Eigen::Vector3d position_before(const Eigen::Vector3d& place, const Eigen::Vector3d& error) const {
    return place + error + place.cross(xi_);
  }
  /// A feature with its error (dim() components), before the world rotates; the second overload takes its
  /// J_before_rotation(), if already computed.
  [[nodiscard]] Feature feature_before(const Feature& feature, std::span<const double> error) const;
  [[nodiscard]] Feature feature_before(const Feature& feature, std::span<const double> error,
                                       const Eigen::Matrix<double, 6, 3>& J_before) const;
  [[nodiscard]] const Eigen::Matrix3d& world_from_cam() const { return world_from_cam_; }  ///< R̂.
  [[nodiscard]] const Eigen::Vector3d& xi() const { return xi_; }

  [[nodiscard]] Eigen::Matrix3d G() const;
  /// Rotates a feature as returned by feature_before().
  [[nodiscard]] static Feature turned(const Eigen::Matrix3d& G, const Feature& before);
  /// For an inverse depth: derivative of θ, φ, ρ after the rotation with respect to those of feature_before().
  [[nodiscard]] static Eigen::Matrix3d J_rotated_angles(const Eigen::Matrix3d& G, const Feature& before);

 private:
  Eigen::Matrix3d world_from_cam_;
  Eigen::Vector3d xi_;
};

/// Derivative of feature_before() by ξ: [p̂]×, and minus the effect of a rotation on the angles; the first dim() rows.
[[nodiscard]] Eigen::Matrix<double, 6, 3> J_before_rotation(const Feature& feature);

}  // namespace alidade
