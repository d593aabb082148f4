#include "alidade/observe/solve/rotation_model.h"

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
  place(nuisances.shutter, shutter, 1);
  place(nuisances.drift, drift, 1);
  place(nuisances.errors > 0, errors, num_errors = nuisances.errors);
  place(nuisances.learnt, learnt, 4);
  place(nuisances.rotation, rotation, 3);
}

namespace {

/// Distorted position of a ray in the normalised image plane (focal length one), with derivatives; Brown 1971.
struct Bent {
  Eigen::Vector2d xy;
  double dxx, cross, dyy;  ///< ∂x'/∂x, ∂x'/∂y = ∂y'/∂x, ∂y'/∂y
};

/// False beyond the radius at which the distortion folds over.
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

/// Derivative of the pixel by the point in the camera frame.
Eigen::Matrix<double, 2, 3> pixel_by_cam(const Eigen::Vector4d& k, const Eigen::Vector3d& d, const Bent& bent) {
  const double iz = 1.0 / d.z(), x = d.x() * iz, y = d.y() * iz;
  Eigen::Matrix<double, 2, 3> J;
  J << k[0] * bent.dxx * iz, k[0] * bent.cross * iz, -k[0] * (bent.dxx * x + bent.cross * y) * iz,
      k[1] * bent.cross * iz, k[1] * bent.dyy * iz, -k[1] * (bent.cross * x + bent.dyy * y) * iz;
  return J;
}

/// Exp(φ + δ) = Exp(J δ) Exp(φ) to first order. Solà, Deray & Atchuthan, "A micro Lie theory", 2018, eq. (145).
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& phi) {
  const double theta2 = phi.squaredNorm(), theta = std::sqrt(theta2);
  const Eigen::Matrix3d cross = cross_matrix(phi);
  constexpr double small = 1e-6;
  const double a = theta2 < small ? 0.5 - theta2 / 24.0 : (1.0 - std::cos(theta)) / theta2;
  const double b = theta2 < small ? 1.0 / 6.0 - theta2 / 120.0 : (theta - std::sin(theta)) / (theta2 * theta);
  return Eigen::Matrix3d::Identity() + a * cross + b * cross * cross;
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
  if (layout.shutter >= 0) moved.shutter_s += step[layout.shutter];
  if (layout.drift >= 0) moved.drift_per_s += step[layout.drift];
  if (layout.errors >= 0) {
    if (moved.errors.size() != layout.num_errors) moved.errors = RotationErrors::Zero(layout.num_errors);
    moved.errors += step.segment(layout.errors, layout.num_errors);
  }
  if (layout.rotation >= 0) moved.rotation_error_rad += step.segment<3>(layout.rotation);
  return moved;
}

Eigen::Vector4d RotatingCamera::k_at(double t_s) const {
  Eigen::Vector4d now = k;
  now.head<2>() *= 1.0 + drift_per_s * (t_s - drift_from_s);
  return now;
}

RotationView::RotationView(const RotatingCamera& camera, const RotationFrame& frame)
    : camera_(camera),
      measured_(frame.cam_from_start),
      measured_rate_(frame.rate_rad_per_s),
      acceleration_(frame.acceleration_rad_per_s2),
      shift_m_(frame.shift_m),
      turn_by_(frame.turn_by),
      cam_from_mount_(camera.cam_from_mount.toRotationMatrix()),
      k_(camera.k_at(frame.t_s)),
      growth_(1.0 + camera.drift_per_s * (frame.t_s - camera.drift_from_s)),
      elapsed_s_(frame.t_s - camera.drift_from_s) {
  turn_to(camera.delay_s);
}

void RotationView::turn_to(double late_s) {
  mount_from_start_ = measured_.toRotationMatrix();
  rate_ = measured_rate_;
  if (late_s != 0.0) {
    const Eigen::Vector3d mean_rate = rate_ + 0.5 * late_s * acceleration_;
    mount_from_start_ = exp_so3(-late_s * mean_rate).toRotationMatrix() * mount_from_start_;
    rate_ += late_s * acceleration_;
  }
  if (camera_.errors.size() > 0 && turn_by_.cols() == camera_.errors.size()) {
    const Eigen::Matrix3d turn = exp_so3(turn_by_ * camera_.errors).toRotationMatrix();
    mount_from_start_ = turn * mount_from_start_;
    rate_ = turn * rate_;
  }
  if (!camera_.rotation_error_rad.isZero(0.0)) {
    mount_from_start_ = exp_so3(camera_.rotation_error_rad).toRotationMatrix() * mount_from_start_;
  }
  cam_from_start_ = cam_from_mount_ * mount_from_start_ * cam_from_mount_.transpose();
}

double RotationView::late_at_row(double v) const {
  return camera_.delay_s + camera_.shutter_s * v / camera_.image_height;
}

bool RotationView::turn_to_row_of(const BearingPoint& point) {
  double late_s = camera_.delay_s;
  constexpr int max_rounds = 12;  // each leaves about 1 % of the error: within one row time a point moves by few rows
  for (int i = 0; i < max_rounds; ++i) {
    const auto px = project_at_once(point);
    if (!px) return false;
    const double next_s = late_at_row(px->y());
    if (std::abs(next_s - late_s) < 1e-15) break;
    turn_to(late_s = next_s);
  }
  return true;
}

Eigen::Vector3d RotationView::point_in_cam(const BearingPoint& point) const {
  const Eigen::Vector3d ray = cam_from_start_ * point.ray();
  if (point.inverse_depth == 0.0) return ray;
  return ray + point.inverse_depth * (cam_from_start_ * camera_.lever_m - camera_.lever_m + shift_m_);
}

std::optional<Eigen::Vector2d> RotationView::project(const BearingPoint& point) const {
  if (camera_.shutter_s == 0.0) return project_at_once(point);
  RotationView late = *this;
  if (!late.turn_to_row_of(point)) return std::nullopt;
  return late.project_at_once(point);
}

std::optional<Eigen::Vector2d> RotationView::project_at_once(const BearingPoint& point) const {
  const Eigen::Vector3d d = point_in_cam(point);
  if (!(d.z() > 1e-9)) return std::nullopt;
  Bent bent;
  if (!bend(camera_, d.x() / d.z(), d.y() / d.z(), bent)) return std::nullopt;
  return Eigen::Vector2d(k_[0] * bent.xy.x() + k_[2], k_[1] * bent.xy.y() + k_[3]);
}

bool RotationView::predict(const BearingPoint& point, const CommonLayout& layout, RotationPrediction& out) const {
  const bool rolls = layout.shutter >= 0 || camera_.shutter_s != 0.0;
  return rolls ? predict_by_rows(point, layout, out) : predict_at_once(point, layout, out);
}

/// When a pixel moves, its row and thus its time change too: dp = P dθ + (∂p/∂t) (shutter / height) dp_y, solved for
/// dp.
bool RotationView::predict_by_rows(const BearingPoint& point, const CommonLayout& layout,
                                   RotationPrediction& out) const {
  RotationView late = *this;
  if (!late.turn_to_row_of(point) || !late.predict_at_once(point, layout, out)) return false;
  const Eigen::Vector3d d = late.point_in_cam(point);
  Bent bent;
  if (!bend(camera_, d.x() / d.z(), d.y() / d.z(), bent)) return false;
  const Eigen::Vector2d by_time = pixel_by_cam(k_, d, bent) * (-cam_from_mount_ * late.rate_.cross(late.turned(point)));
  if (layout.shutter >= 0) out.J_px_common.col(layout.shutter) = by_time * (out.px.y() / camera_.image_height);
  const double share = camera_.shutter_s / camera_.image_height;
  const Eigen::Vector2d follow = by_time * (share / (1.0 - share * by_time.y()));
  out.J_px_common += (follow * out.J_px_common.row(1)).eval();
  out.J_px_point += (follow * out.J_px_point.row(1)).eval();
  return true;
}

bool RotationView::predict_at_once(const BearingPoint& point, const CommonLayout& layout,
                                   RotationPrediction& out) const {
  const Eigen::Vector3d d = point_in_cam(point);
  if (!(d.z() > 1e-9)) return false;
  const double iz = 1.0 / d.z(), x = d.x() * iz, y = d.y() * iz, r2 = x * x + y * y;
  Bent bent;
  if (!bend(camera_, x, y, bent)) return false;
  const double fx = k_[0], fy = k_[1];
  out.px = {fx * bent.xy.x() + k_[2], fy * bent.xy.y() + k_[3]};
  const Eigen::Matrix<double, 2, 3> J_px_d = pixel_by_cam(k_, d, bent);
  out.J_px_common.resize(2, layout.size);
  out.J_px_common.leftCols<4>() << growth_ * bent.xy.x(), 0.0, 1.0, 0.0, 0.0, growth_ * bent.xy.y(), 0.0, 1.0;
  if (layout.size == 4 && point.inverse_depth == 0.0 && shift_m_.isZero(0.0) && camera_.lever_m.isZero(0.0)) {
    const Eigen::Matrix3d cam_from_point = cam_from_start_ * point.start_from_point;
    out.J_px_point.leftCols<2>().noalias() = J_px_d * cam_from_point.leftCols<2>();
    out.J_px_point.col(2).setZero();
    return true;
  }
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, max_common> J_d_common(3, layout.size);
  Eigen::Matrix3d J_d_point;
  point_jacobians(point, layout, J_d_common, J_d_point);
  for (int column = 4; column < layout.size; ++column) {
    out.J_px_common.col(column).noalias() = J_px_d * J_d_common.col(column);
  }
  if (layout.drift >= 0) {
    out.J_px_common.col(layout.drift) = elapsed_s_ * bent.xy.cwiseProduct(camera_.k.head<2>());
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
                                   Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, max_common>& J_common,
                                   Eigen::Matrix3d& J_point) const {
  const double chi = point.inverse_depth;
  const Eigen::Vector3d in_mount = cam_from_mount_.transpose() * (point.ray() + chi * camera_.lever_m);
  const Eigen::Vector3d turned = mount_from_start_ * in_mount;
  const Eigen::Matrix3d by_rotation = -cam_from_mount_ * cross_matrix(turned);
  J_common.setZero(3, layout.size);
  if (layout.mount >= 0) {
    J_common.middleCols<3>(layout.mount) =
        cam_from_mount_ * (mount_from_start_ * cross_matrix(in_mount) - cross_matrix(turned));
  }
  if (layout.delay >= 0) J_common.col(layout.delay) = -cam_from_mount_ * rate_.cross(turned);
  if (layout.lever >= 0) {
    J_common.middleCols<3>(layout.lever) = chi * (cam_from_start_ - Eigen::Matrix3d::Identity());
  }
  if (layout.errors >= 0 && turn_by_.cols() == layout.num_errors) {
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    if (camera_.errors.size() == layout.num_errors) turn = left_jacobian(turn_by_ * camera_.errors);
    J_common.middleCols(layout.errors, layout.num_errors).noalias() = by_rotation * turn * turn_by_;
  }
  if (layout.rotation >= 0) J_common.middleCols<3>(layout.rotation) = by_rotation;
  J_point.leftCols<2>() = cam_from_start_ * point.start_from_point.leftCols<2>();
  J_point.col(2) = cam_from_start_ * camera_.lever_m - camera_.lever_m + shift_m_;
}

Eigen::Vector3d RotationView::turned(const BearingPoint& point) const {
  return mount_from_start_ * (cam_from_mount_.transpose() * (point.ray() + point.inverse_depth * camera_.lever_m));
}

std::optional<Eigen::Vector3d> RotationView::ray_in_start(const Eigen::Vector2d& px) const {
  RotationView late = *this;
  if (camera_.shutter_s != 0.0) late.turn_to(late_at_row(px.y()));
  const Eigen::Vector2d wanted((px.x() - k_[2]) / k_[0], (px.y() - k_[3]) / k_[1]);
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
  return Eigen::Vector3d(late.cam_from_start_.transpose() * Eigen::Vector3d(ray.x(), ray.y(), 1.0).normalized());
}

Eigen::Vector4d sigma_k_at(const RotatingCamera& camera, const CommonLayout& layout, const CommonMatrix& cov,
                           double t_s) {
  Eigen::Vector4d variance = cov.diagonal().head<4>();
  if (layout.drift >= 0) {
    const double elapsed_s = t_s - camera.drift_from_s, growth = 1.0 + camera.drift_per_s * elapsed_s;
    for (Eigen::Index i = 0; i < 2; ++i) {
      const double by_drift = camera.k[i] * elapsed_s;
      variance[i] = growth * growth * cov(i, i) + 2.0 * growth * by_drift * cov(i, layout.drift) +
                    by_drift * by_drift * cov(layout.drift, layout.drift);
    }
  }
  return variance.cwiseSqrt();
}

Eigen::Matrix3d rotation_to(const Eigen::Vector3d& ray) {
  return rotation_between(Eigen::Vector3d::UnitZ(), ray).toRotationMatrix();
}

}  // namespace alidade
