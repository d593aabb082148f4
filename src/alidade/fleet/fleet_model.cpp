#include "alidade/fleet/fleet_model.h"

#include <cmath>

#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

Eigen::Matrix3d turned_about(int axis, double angle_rad) {
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();
  vector[axis] = angle_rad;
  return exp_so3(vector).toRotationMatrix();
}

}  // namespace

FleetView::FleetView(const FleetRotation& rotation, const FleetCommon& common, double warmer_c)
    : common_(common),
      warmer_c_(warmer_c),
      zoom_(1.0 + common[6] * warmer_c),
      cam_from_base_(rotation.after.transpose() * turned_about(0, -common[5]) * rotation.before.transpose() *
                     turned_about(1, common[4])),
      tilt_axis_in_cam_(rotation.after.transpose().col(0)) {}

FleetPrediction FleetView::predict(const Eigen::Vector3d& ray_in_base) const {
  FleetPrediction prediction;
  const Eigen::Vector3d p = cam_from_base_ * ray_in_base;
  if (!(p.z() > 1e-3)) return prediction;
  prediction.is_seen = true;
  const double fx = zoom_ * common_[0], fy = zoom_ * common_[1], x = p.x() / p.z(), y = p.y() / p.z();
  prediction.px = {fx * x + common_[2], fy * y + common_[3]};
  Eigen::Matrix<double, 2, 3> by_point;
  by_point << fx / p.z(), 0.0, -fx * x / p.z(), 0.0, fy / p.z(), -fy * y / p.z();
  prediction.by_ray = by_point * cam_from_base_;
  const Eigen::Vector3d by_pan = cam_from_base_ * Eigen::Vector3d::UnitY().cross(ray_in_base);
  const Eigen::Vector3d by_tilt = -tilt_axis_in_cam_.cross(p);
  prediction.by_common.setZero();
  prediction.by_common.leftCols<4>() << zoom_ * x, 0.0, 1.0, 0.0, 0.0, zoom_ * y, 0.0, 1.0;
  prediction.by_common.col(6) = warmer_c_ * Eigen::Vector2d(common_[0] * x, common_[1] * y);
  prediction.by_common.col(4) = by_point * by_pan;
  prediction.by_common.col(5) = by_point * by_tilt;
  return prediction;
}

Eigen::Vector3d FleetView::ray_of(const Eigen::Vector2d& px) const {
  const Eigen::Vector3d in_cam((px.x() - common_[2]) / (zoom_ * common_[0]),
                               (px.y() - common_[3]) / (zoom_ * common_[1]), 1.0);
  return (cam_from_base_.transpose() * in_cam).normalized();
}

Eigen::Matrix<double, 3, 2> basis_beside(const Eigen::Vector3d& direction) {
  const Eigen::Vector3d other = std::abs(direction.x()) < 0.6 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = direction.cross(other).normalized();
  basis.col(1) = direction.cross(basis.col(0));
  return basis;
}

FleetRotation rotation_of(const FleetCamera& camera, const FleetRow& row) {
  const auto& r = row.rotation;
  FleetRotation rotation;
  if (row.source == FleetSource::head) {
    rotation.before = turned_about(1, -r[0]) * turned_about(0, r[1]);
    rotation.after = turned_about(2, r[2]);
  } else if (row.source == FleetSource::attitude) {
    rotation.before = Eigen::Quaterniond(r[0], r[1], r[2], r[3]).normalized().toRotationMatrix();
  } else {
    const auto& q = camera.attitude;
    Eigen::Quaterniond base_from_cam(q[0], q[1], q[2], q[3]);
    if (camera.has_row != 0) {
      const Eigen::Vector3d before(camera.rate[0], camera.rate[1], camera.rate[2]), now(r[0], r[1], r[2]);
      base_from_cam = (base_from_cam * exp_so3(0.5 * (before + now) * (row.t_s - camera.t_s))).normalized();
    }
    rotation.before = base_from_cam.toRotationMatrix();
  }
  return rotation;
}

}  // namespace alidade
