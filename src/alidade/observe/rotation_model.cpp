#include "alidade/observe/rotation_model.h"

#include <cmath>

#include "alidade/geometry/so3.h"

namespace alidade {

CommonLayout::CommonLayout(const ObserveNuisances& nuisances) {
  const auto place = [this](bool wanted, int& index, int width) {
    if (!wanted) return;
    index = size;
    size += width;
  };
  place(nuisances.k1, k1, 1);
  place(nuisances.k2, k2, 1);
  place(nuisances.k3, k3, 1);
  place(nuisances.tangential, tangential, 2);
  place(nuisances.mount, mount, 3);
  place(nuisances.delay, delay, 1);
  place(nuisances.lever, lever, 3);
  place(nuisances.learnt, learnt, 4);
  place(nuisances.turn, turn, 3);
}

namespace {

/// A ray's place in the picture of focal length one, bent by the lens; Brown 1971.
struct Bent {
  Eigen::Vector2d xy;
  double dxx, cross, dyy;  ///< ∂x'/∂x, ∂x'/∂y = ∂y'/∂x, ∂y'/∂y
};

/// False beyond the fold of the lens.
bool bend(const RotatingCamera& c, double x, double y, Bent& bent) {
  const double r2 = x * x + y * y;
  if (!(1.0 + r2 * (3.0 * c.k1 + r2 * (5.0 * c.k2 + r2 * 7.0 * c.k3)) > 0.0)) return false;
  const double radial = 1.0 + r2 * (c.k1 + r2 * (c.k2 + r2 * c.k3));
  const double slope = 2.0 * (c.k1 + r2 * (2.0 * c.k2 + r2 * 3.0 * c.k3));
  bent.xy = {x * radial + 2.0 * c.p1 * x * y + c.p2 * (r2 + 2.0 * x * x),
             y * radial + c.p1 * (r2 + 2.0 * y * y) + 2.0 * c.p2 * x * y};
  bent.dxx = radial + slope * x * x + 2.0 * c.p1 * y + 6.0 * c.p2 * x;
  bent.cross = slope * x * y + 2.0 * c.p1 * x + 2.0 * c.p2 * y;
  bent.dyy = radial + slope * y * y + 6.0 * c.p1 * y + 2.0 * c.p2 * x;
  return true;
}

}  // namespace

RotatingCamera RotatingCamera::retract(const CommonLayout& layout, const CommonVector& step) const {
  RotatingCamera moved = *this;
  moved.k += step.head<4>();
  if (layout.k1 >= 0) moved.k1 += step[layout.k1];
  if (layout.k2 >= 0) moved.k2 += step[layout.k2];
  if (layout.k3 >= 0) moved.k3 += step[layout.k3];
  if (layout.tangential >= 0) {
    moved.p1 += step[layout.tangential];
    moved.p2 += step[layout.tangential + 1];
  }
  if (layout.mount >= 0) {
    moved.cam_from_mount = (cam_from_mount * exp_so3(Eigen::Vector3d(step.segment<3>(layout.mount)))).normalized();
  }
  if (layout.delay >= 0) moved.delay_s += step[layout.delay];
  if (layout.lever >= 0) moved.lever_m += step.segment<3>(layout.lever);
  if (layout.turn >= 0) moved.turn_rad += step.segment<3>(layout.turn);
  return moved;
}

RotationView::RotationView(const RotatingCamera& camera, const RotationFrame& frame)
    : camera_(camera),
      cam_from_mount_(camera.cam_from_mount.toRotationMatrix()),
      rate_(frame.rate_rad_per_s),
      shift_m_(frame.shift_m) {
  mount_from_start_ = frame.cam_from_start.toRotationMatrix();
  if (camera.delay_s != 0.0) {
    const Eigen::Vector3d mean_rate = rate_ + 0.5 * camera.delay_s * frame.acceleration_rad_per_s2;
    mount_from_start_ = exp_so3(-camera.delay_s * mean_rate).toRotationMatrix() * mount_from_start_;
    rate_ += camera.delay_s * frame.acceleration_rad_per_s2;
  }
  if (!camera.turn_rad.isZero(0.0)) mount_from_start_ = exp_so3(camera.turn_rad).toRotationMatrix() * mount_from_start_;
  cam_from_start_ = cam_from_mount_ * mount_from_start_ * cam_from_mount_.transpose();
}

Eigen::Vector3d RotationView::point_in_cam(const BearingPoint& point) const {
  const Eigen::Vector3d ray = cam_from_start_ * point.ray();
  if (point.inverse_depth == 0.0) return ray;
  return ray + point.inverse_depth * (cam_from_start_ * camera_.lever_m - camera_.lever_m + shift_m_);
}

std::optional<Eigen::Vector2d> RotationView::project(const BearingPoint& point) const {
  const Eigen::Vector3d d = point_in_cam(point);
  if (!(d.z() > 1e-9)) return std::nullopt;
  Bent bent;
  if (!bend(camera_, d.x() / d.z(), d.y() / d.z(), bent)) return std::nullopt;
  return Eigen::Vector2d(camera_.k[0] * bent.xy.x() + camera_.k[2], camera_.k[1] * bent.xy.y() + camera_.k[3]);
}

bool RotationView::predict(const BearingPoint& point, const CommonLayout& layout, RotationPrediction& out) const {
  const Eigen::Vector3d d = point_in_cam(point);
  if (!(d.z() > 1e-9)) return false;
  const double iz = 1.0 / d.z(), x = d.x() * iz, y = d.y() * iz, r2 = x * x + y * y;
  Bent bent;
  if (!bend(camera_, x, y, bent)) return false;
  const double fx = camera_.k[0], fy = camera_.k[1], dxx = bent.dxx, cross = bent.cross, dyy = bent.dyy;
  out.px = {fx * bent.xy.x() + camera_.k[2], fy * bent.xy.y() + camera_.k[3]};
  Eigen::Matrix<double, 2, 3> J_px_d;
  J_px_d << fx * dxx * iz, fx * cross * iz, -fx * (dxx * x + cross * y) * iz,  //
      fy * cross * iz, fy * dyy * iz, -fy * (cross * x + dyy * y) * iz;
  out.J_px_common.resize(2, layout.size);
  out.J_px_common.leftCols<4>() << bent.xy.x(), 0.0, 1.0, 0.0, 0.0, bent.xy.y(), 0.0, 1.0;
  if (layout.size == 4 && point.inverse_depth == 0.0 && shift_m_.isZero(0.0) && camera_.lever_m.isZero(0.0)) {
    const Eigen::Matrix3d cam_from_point = cam_from_start_ * point.start_from_point;
    out.J_px_point.leftCols<2>().noalias() = J_px_d * cam_from_point.leftCols<2>();
    out.J_px_point.col(2).setZero();
    return true;
  }
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, most_common> J_d_common(3, layout.size);
  Eigen::Matrix3d J_d_point;
  point_jacobians(point, layout, J_d_common, J_d_point);
  for (int column = 4; column < layout.size; ++column) {
    out.J_px_common.col(column).noalias() = J_px_d * J_d_common.col(column);
  }
  const Eigen::Vector2d radial(fx * x * r2, fy * y * r2);
  if (layout.k1 >= 0) out.J_px_common.col(layout.k1) = radial;
  if (layout.k2 >= 0) out.J_px_common.col(layout.k2) = radial * r2;
  if (layout.k3 >= 0) out.J_px_common.col(layout.k3) = radial * (r2 * r2);
  if (layout.tangential >= 0) {
    out.J_px_common.middleCols<2>(layout.tangential) << fx * 2.0 * x * y, fx * (r2 + 2.0 * x * x),
        fy * (r2 + 2.0 * y * y), fy * 2.0 * x * y;
  }
  out.J_px_point.noalias() = J_px_d * J_d_point;
  return true;
}

void RotationView::point_jacobians(const BearingPoint& point, const CommonLayout& layout,
                                   Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, most_common>& J_common,
                                   Eigen::Matrix3d& J_point) const {
  const double chi = point.inverse_depth;
  const Eigen::Vector3d in_mount = cam_from_mount_.transpose() * (point.ray() + chi * camera_.lever_m);
  const Eigen::Vector3d turned = mount_from_start_ * in_mount;
  J_common.setZero(3, layout.size);
  if (layout.mount >= 0) {
    J_common.middleCols<3>(layout.mount) =
        cam_from_mount_ * (mount_from_start_ * cross_matrix(in_mount) - cross_matrix(turned));
  }
  if (layout.delay >= 0) J_common.col(layout.delay) = -cam_from_mount_ * rate_.cross(turned);
  if (layout.lever >= 0) {
    J_common.middleCols<3>(layout.lever) = chi * (cam_from_start_ - Eigen::Matrix3d::Identity());
  }
  if (layout.turn >= 0) J_common.middleCols<3>(layout.turn) = -cam_from_mount_ * cross_matrix(turned);
  J_point.leftCols<2>() = cam_from_start_ * point.start_from_point.leftCols<2>();
  J_point.col(2) = cam_from_start_ * camera_.lever_m - camera_.lever_m + shift_m_;
}

std::optional<Eigen::Vector3d> RotationView::ray_in_start(const Eigen::Vector2d& px) const {
  const Eigen::Vector2d wanted((px.x() - camera_.k[2]) / camera_.k[0], (px.y() - camera_.k[3]) / camera_.k[1]);
  Eigen::Vector2d ray = wanted;
  for (int i = 0; i < 30; ++i) {
    Bent bent;
    if (!bend(camera_, ray.x(), ray.y(), bent)) return std::nullopt;  // beyond the fold
    const Eigen::Vector2d error = bent.xy - wanted;
    const double det = bent.dxx * bent.dyy - bent.cross * bent.cross;
    if (!(det > 0.0)) return std::nullopt;
    const Eigen::Vector2d step(bent.dyy * error.x() - bent.cross * error.y(),
                               bent.dxx * error.y() - bent.cross * error.x());
    ray -= step / det;
    if (step.norm() < 1e-14 * det) break;
  }
  return Eigen::Vector3d(cam_from_start_.transpose() * Eigen::Vector3d(ray.x(), ray.y(), 1.0).normalized());
}

Eigen::Matrix3d rotation_to(const Eigen::Vector3d& ray) {
  return rotation_between(Eigen::Vector3d::UnitZ(), ray).toRotationMatrix();
}

}  // namespace alidade
