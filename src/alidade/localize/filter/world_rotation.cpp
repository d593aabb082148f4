#include "alidade/localize/filter/world_rotation.h"

#include <Eigen/Geometry>

namespace alidade {
namespace {

/// Derivative of the angles of a direction with respect to a rotation of the world.
Eigen::Matrix<double, 2, 3> J_angles_turn(const BearingAngles& bearing) {
  Eigen::Matrix<double, 2, 3> J;
  J.row(0) = bearing.m.cross(bearing.m_theta).transpose() / bearing.m_theta.squaredNorm();
  J.row(1) = bearing.m.cross(bearing.m_phi).transpose() / bearing.m_phi.squaredNorm();
  return J;
}

}  // namespace

WorldRotation::WorldRotation(const Rigid3& world_from_cam, const Eigen::Vector3d& rotation_error)
    : world_from_cam_(world_from_cam.rotation.toRotationMatrix()), xi_(world_from_cam_ * rotation_error) {}

Eigen::Matrix3d WorldRotation::G() const { return exp_so3(xi_).toRotationMatrix(); }

Feature WorldRotation::feature_before(const Feature& feature, std::span<const double> error) const {
  return feature_before(feature, error, J_before_rotation(feature));
}

Feature WorldRotation::feature_before(const Feature& feature, std::span<const double> error,
                                      const Eigen::Matrix<double, 6, 3>& J_before) const {
  Feature before = feature;
  before.values.head<3>() = position_before(feature.values.head<3>(), Eigen::Map<const Eigen::Vector3d>(error.data()));
  if (feature.kind == FeatureKind::xyz) return before;
  before.values.tail<3>() += Eigen::Map<const Eigen::Vector3d>(error.data() + 3);
  before.values.segment<2>(3) += J_before.middleRows<2>(3) * xi_;
  return before;
}

Eigen::Matrix3d WorldRotation::J_rotated_angles(const Eigen::Matrix3d& G, const Feature& before) {
  const BearingAngles was = bearing_of(before.values[3], before.values[4]);
  const AnglesOfBearing is = angles_of(G * was.m);
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J.block<2, 1>(0, 0) = is.J * G * was.m_theta;
  J.block<2, 1>(0, 1) = is.J * G * was.m_phi;
  return J;
}

Feature WorldRotation::turned(const Eigen::Matrix3d& G, const Feature& before) {
  Feature feature = before;
  feature.values.head<3>() = G * before.values.head<3>();
  if (before.kind == FeatureKind::xyz) return feature;
  const AnglesOfBearing angles = angles_of(G * bearing_of(before.values[3], before.values[4]).m);
  feature.values[3] = angles.theta;
  feature.values[4] = angles.phi;
  return feature;
}

Eigen::Matrix<double, 6, 3> J_before_rotation(const Feature& feature) {
  Eigen::Matrix<double, 6, 3> J = Eigen::Matrix<double, 6, 3>::Zero();
  J.topRows<3>() = cross_matrix(feature.values.head<3>());
  if (feature.kind == FeatureKind::inverse_depth)
    J.middleRows<2>(3) = -J_angles_turn(bearing_of(feature.values[3], feature.values[4]));
  return J;
}

}  // namespace alidade
