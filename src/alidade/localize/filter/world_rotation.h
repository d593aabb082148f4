#pragma once

#include <Eigen/Core>
#include <span>

#include "alidade/localize/filter/feature.h"

// No measurement but that of known points determines how the world is rotated about its origin: camera, speed and map
// may rotate together. An EKF, linearised at its changing estimate, loses that: the unobservable direction differs from
// one update to the next, and so it gains information that no measurement gave (S. J. Julier & J.
// K. Uhlmann, "A Counter Example to the Theory of SLAM", ICRA 2001). So errors are counted as in the right-invariant
// filter (A. Barrau & S. Bonnabel, "An EKF-SLAM Algorithm with Consistency Properties", 2015): with the rotation ξ = R̂
// δθ of the world, G = exp(ξ), and the error δ of a position p̂,
//     p = G (p̂ + δ + p̂ × ξ)        for the camera, its velocity, points, and where inverse depths begin,
// which to first order is p̂ + δ. What is seen is a function of the bracket alone: the position before the world
// rotates. Once the state has moved to p̂′ = Ĝ (…), errors are counted from there: with J the left Jacobian of ξ̂ and the
// new ε_ξ = J ξ, δ′ = Ĝ (δ + p̂ × ξ) − p̂′ × ε_ξ.
//
// That is linear for small rotations only: by a large one, as at a start or after a gap, a camera that rotates in place
// would have to move by ½ ξ² p̂. Such an update moves positions by δ alone, and holds the frame by its derivatives:
// those by the rotation are less by what the rotation makes of p̂′ − p̂, so that they fit the covariance, which counts
// errors from p̂.

namespace alidade {

/// The rotation of the world that corresponds to a right rotation error of the camera.
class WorldRotation {
 public:
  WorldRotation(const Rigid3& world_from_cam, const Eigen::Vector3d& rotation_error);

  /// p̂ + δ + p̂ × ξ, the bracket above.
  [[nodiscard]] Eigen::Vector3d position_before(const Eigen::Vector3d& place, const Eigen::Vector3d& error) const {
    return place + error + place.cross(xi_);
  }
  /// A feature with its error (dim() components), before the world rotates; with its J_before_rotation(), where that is
  /// at hand.
  [[nodiscard]] Feature feature_before(const Feature& feature, std::span<const double> error) const;
  [[nodiscard]] Feature feature_before(const Feature& feature, std::span<const double> error,
                                       const Eigen::Matrix<double, 6, 3>& J_before) const;
  [[nodiscard]] const Eigen::Matrix3d& world_from_cam() const { return world_from_cam_; }  ///< R̂.
  [[nodiscard]] const Eigen::Vector3d& xi() const { return xi_; }

  [[nodiscard]] Eigen::Matrix3d G() const;
  /// A feature, as feature_before() gives it, rotated.
  [[nodiscard]] static Feature turned(const Eigen::Matrix3d& G, const Feature& before);
  /// Of an inverse depth: derivative of θ, φ, ρ after the rotation by those of feature_before().
  [[nodiscard]] static Eigen::Matrix3d J_rotated_angles(const Eigen::Matrix3d& G, const Feature& before);

 private:
  Eigen::Matrix3d world_from_cam_;
  Eigen::Vector3d xi_;
};

/// Derivative of feature_before() by ξ: [p̂]×, and minus what a rotation does to the angles. The first dim() rows.
[[nodiscard]] Eigen::Matrix<double, 6, 3> J_before_rotation(const Feature& feature);

}  // namespace alidade
