#include "alidade/pantilt/head.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace alidade {
namespace {

/// Exp(angle e_y) and Exp(−angle e_x): how coordinates follow a pan and a tilt.
Eigen::Matrix3d pan_rotation(double angle_rad) {
  const double c = std::cos(angle_rad), s = std::sin(angle_rad);
  return (Eigen::Matrix3d() << c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c).finished();
}

Eigen::Matrix3d tilt_rotation(double angle_rad) {
  const double c = std::cos(angle_rad), s = std::sin(angle_rad);
  return (Eigen::Matrix3d() << 1.0, 0.0, 0.0, 0.0, c, s, 0.0, -s, c).finished();
}

/// Exp(−skew e_z).
Eigen::Matrix3d skew_rotation(double skew_rad) {
  const double c = std::cos(skew_rad), s = std::sin(skew_rad);
  return (Eigen::Matrix3d() << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0).finished();
}

double wrapped(double angle_rad) { return std::atan2(std::sin(angle_rad), std::cos(angle_rad)); }

/// The angles at which a head without offsets sees the direction of a base on the ray (unit vectors both). Exact.
std::optional<Eigen::Vector2d> angles_without_offsets(const Eigen::Vector3d& direction_in_base,
                                                      const Eigen::Vector3d& ray_in_tilt) {
  const double reach = std::hypot(ray_in_tilt.y(), ray_in_tilt.z());
  if (!(reach > 1e-9) || !(std::abs(direction_in_base.y()) <= reach)) return std::nullopt;
  const double tilt = std::atan2(ray_in_tilt.y(), ray_in_tilt.z()) - std::asin(direction_in_base.y() / reach);
  const double depth = std::sin(tilt) * ray_in_tilt.y() + std::cos(tilt) * ray_in_tilt.z();
  const double pan = std::atan2(ray_in_tilt.x(), depth) - std::atan2(direction_in_base.x(), direction_in_base.z());
  return Eigen::Vector2d(wrapped(pan), wrapped(tilt));
}

}  // namespace

Eigen::Vector2d Encoder::corrected(const Eigen::Vector2d& r) const {
  if (pan_cos_rad == 0.0 && pan_sin_rad == 0.0 && tilt_cos_rad == 0.0 && tilt_sin_rad == 0.0) return r;
  return {r.x() + pan_cos_rad * std::cos(r.x()) + pan_sin_rad * std::sin(r.x()),
          r.y() + tilt_cos_rad * std::cos(r.y()) + tilt_sin_rad * std::sin(r.y())};
}

Eigen::Vector2d Encoder::slopes(const Eigen::Vector2d& r) const {
  if (pan_cos_rad == 0.0 && pan_sin_rad == 0.0 && tilt_cos_rad == 0.0 && tilt_sin_rad == 0.0)
    return {pan_scale, tilt_scale};
  return {pan_scale * (1.0 - pan_cos_rad * std::sin(r.x()) + pan_sin_rad * std::cos(r.x())),
          tilt_scale * (1.0 - tilt_cos_rad * std::sin(r.y()) + tilt_sin_rad * std::cos(r.y()))};
}

Eigen::Vector2d Encoder::angles(const Eigen::Vector2d& readings_rad) const {
  const Eigen::Vector2d r = corrected(readings_rad);
  return {pan_scale * (r.x() - pan_zero_rad), tilt_scale * (r.y() - tilt_zero_rad)};
}

/// The error of one period per turn is taken away by a contraction: its amplitude is the factor of each step.
Eigen::Vector2d Encoder::readings(const Eigen::Vector2d& angles_rad) const {
  const Eigen::Vector2d wanted(angles_rad.x() / pan_scale + pan_zero_rad, angles_rad.y() / tilt_scale + tilt_zero_rad);
  constexpr int max_steps = 60;
  Eigen::Vector2d r = wanted;
  for (int step = 0; step < max_steps; ++step) {
    const Eigen::Vector2d off = corrected(r) - wanted;
    r -= off;
    if (off.cwiseAbs().maxCoeff() < 1e-15) break;
  }
  return r;
}

Head retract(const Head& head, const HeadVector& step) {
  Head moved = head;
  moved.world_from_base = head.world_from_base.retract(step.head<6>());
  moved.pan_to_tilt_m += step.segment<3>(6);
  moved.tilt_to_cam_m += step.segment<3>(9);
  moved.cam_from_tilt = (head.cam_from_tilt * exp_so3(step.segment<3>(12))).normalized();
  moved.encoder.pan_zero_rad += step[15];
  moved.encoder.tilt_zero_rad += step[16];
  moved.encoder.pan_scale += step[17];
  moved.encoder.tilt_scale += step[18];
  moved.axes_skew_rad += step[19];
  moved.encoder.pan_cos_rad += step[20];
  moved.encoder.pan_sin_rad += step[21];
  moved.encoder.tilt_cos_rad += step[22];
  moved.encoder.tilt_sin_rad += step[23];
  return moved;
}

TurnedHead::TurnedHead(const Head& head, const Eigen::Vector2d& pan_tilt_rad)
    : cam_from_tilt_rotation(head.cam_from_tilt.toRotationMatrix()),
      pan_to_tilt_m(head.pan_to_tilt_m),
      tilt_to_cam_m(head.tilt_to_cam_m),
      readings_rad(pan_tilt_rad),
      scales(head.encoder.pan_scale, head.encoder.tilt_scale),
      angle_per_reading(head.encoder.slopes(pan_tilt_rad)),
      readings_from_zero_rad(head.encoder.corrected(pan_tilt_rad) -
                             Eigen::Vector2d(head.encoder.pan_zero_rad, head.encoder.tilt_zero_rad)) {
  const Eigen::Vector2d angles = scales.cwiseProduct(readings_from_zero_rad);
  pan_from_base_rotation = pan_rotation(angles.x());
  tilt_from_pan_rotation = tilt_rotation(angles.y()) * skew_rotation(head.axes_skew_rad);
  const Eigen::Matrix3d cam_from_pan_rotation = cam_from_tilt_rotation * tilt_from_pan_rotation;
  cam_from_base_rotation = cam_from_pan_rotation * pan_from_base_rotation;
  cam_from_world_rotation = cam_from_base_rotation * head.world_from_base.rotation.toRotationMatrix().transpose();
  cam_from_world_translation = -cam_from_world_rotation * head.world_from_base.translation -
                               cam_from_pan_rotation * pan_to_tilt_m - cam_from_tilt_rotation * tilt_to_cam_m;
}

Eigen::Matrix<double, 3, 2> TurnedHead::J_point_readings(const Eigen::Vector3d& point_in_cam) const {
  const Eigen::Vector3d from_tilt_axis = cam_from_tilt_rotation.transpose() * point_in_cam + tilt_to_cam_m;
  const Eigen::Vector3d from_pan_axis = tilt_from_pan_rotation.transpose() * from_tilt_axis + pan_to_tilt_m;
  Eigen::Matrix<double, 3, 2> J;
  // e_y × p and −e_x × p.
  J.col(0) = cam_from_tilt_rotation *
             (tilt_from_pan_rotation * Eigen::Vector3d(from_pan_axis.z(), 0.0, -from_pan_axis.x())) *
             angle_per_reading.x();
  J.col(1) =
      cam_from_tilt_rotation * Eigen::Vector3d(0.0, from_tilt_axis.z(), -from_tilt_axis.y()) * angle_per_reading.y();
  return J;
}

Eigen::Matrix<double, 3, 6> TurnedHead::J_point_base(const Eigen::Vector3d& point_in_base) const {
  Eigen::Matrix<double, 3, 6> J;
  J << -cam_from_base_rotation, cam_from_base_rotation * cross_matrix(point_in_base);
  return J;
}

Eigen::Vector4d TurnedHead::reading_waves() const {
  return {std::cos(readings_rad.x()), std::sin(readings_rad.x()), std::cos(readings_rad.y()),
          std::sin(readings_rad.y())};
}

Eigen::Matrix<double, 3, num_head_params> TurnedHead::J_point_head(const Eigen::Vector3d& point_in_cam,
                                                                   const Eigen::Vector4d& waves) const {
  const Eigen::Vector3d point_in_tilt = cam_from_tilt_rotation.transpose() * point_in_cam;
  const Eigen::Vector3d from_tilt_axis = point_in_tilt + tilt_to_cam_m;
  const Eigen::Vector3d from_pan_axis = tilt_from_pan_rotation.transpose() * from_tilt_axis + pan_to_tilt_m;
  Eigen::Matrix<double, 3, num_head_params> J;
  J.leftCols<6>() = J_point_base(pan_from_base_rotation.transpose() * from_pan_axis);
  J.middleCols<3>(6) = -cam_from_tilt_rotation * tilt_from_pan_rotation;
  J.middleCols<3>(9) = -cam_from_tilt_rotation;
  J.middleCols<3>(12) = -cam_from_tilt_rotation * cross_matrix(point_in_tilt);
  const Eigen::Matrix<double, 3, 2> J_readings = J_point_readings(point_in_cam);
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector3d by_angle = J_readings.col(axis) / angle_per_reading[axis];
    J.col(15 + axis) = -scales[axis] * by_angle;
    J.col(17 + axis) = readings_from_zero_rad[axis] * by_angle;
    J.col(20 + 2 * axis) = scales[axis] * waves[2 * axis] * by_angle;
    J.col(21 + 2 * axis) = scales[axis] * waves[2 * axis + 1] * by_angle;
  }
  J.col(19) = -cam_from_tilt_rotation * tilt_from_pan_rotation.col(2).cross(from_tilt_axis);
  return J;
}

Rigid3 cam_from_world(const Head& head, const Eigen::Vector2d& pan_tilt_rad) {
  const TurnedHead turned(head, pan_tilt_rad);
  return {Eigen::Quaterniond(turned.cam_from_world_rotation), turned.cam_from_world_translation};
}

Rigid3 world_from_cam(const Head& head, const Eigen::Vector2d& pan_tilt_rad) {
  return cam_from_world(head, pan_tilt_rad).inverse();
}

Eigen::Vector3d cam_centre_in_world(const Head& head, const Eigen::Vector2d& pan_tilt_rad) {
  const TurnedHead turned(head, pan_tilt_rad);
  return -turned.cam_from_world_rotation.transpose() * turned.cam_from_world_translation;
}

std::optional<HeadPixel> project(const TurnedHead& turned, const Camera& camera,
                                 const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector3d point_in_cam = turned.point_in_cam(point_in_world);
  const auto seen = project_with_jacobians(camera, point_in_cam);
  if (!seen) return std::nullopt;
  return HeadPixel{seen->px, point_in_cam, seen->J_px_point * turned.cam_from_world_rotation,
                   seen->J_px_point * turned.J_point_readings(point_in_cam)};
}

std::optional<HeadPixel> project(const RigHead& rig_head, const Eigen::Vector2d& pan_tilt_rad,
                                 const Eigen::Vector3d& point_in_world) {
  return project(TurnedHead(rig_head.head, pan_tilt_rad), rig_head.camera, point_in_world);
}

std::optional<WorldRay> ray_in_world(const RigHead& rig_head, const Eigen::Vector2d& pan_tilt_rad,
                                     const Eigen::Vector2d& px) {
  const auto ray_in_cam = unproject(rig_head.camera, px);
  if (!ray_in_cam) return std::nullopt;
  const TurnedHead turned(rig_head.head, pan_tilt_rad);
  const Eigen::Matrix3d world_from_cam_rotation = turned.cam_from_world_rotation.transpose();
  return WorldRay{-world_from_cam_rotation * turned.cam_from_world_translation, world_from_cam_rotation * *ray_in_cam};
}

std::optional<Eigen::Vector2d> aim(const Head& head, const Eigen::Vector3d& point_in_world,
                                   const Eigen::Vector3d& ray_in_cam) {
  const Eigen::Vector3d point_in_base = head.world_from_base.inverse() * point_in_world;
  const Eigen::Vector3d ray = ray_in_cam.normalized();
  if (!(point_in_base.norm() > 0.0) || !ray.allFinite()) return std::nullopt;
  const auto start = angles_without_offsets(point_in_base.normalized(), head.cam_from_tilt.conjugate() * ray);
  if (!start) return std::nullopt;
  Eigen::Vector2d readings = head.encoder.readings(*start);
  // Two directions across the ray: what the point's offset from it is measured along.
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = ray.unitOrthogonal();
  across.col(1) = ray.cross(across.col(0));
  constexpr int max_steps = 6;  // quadratic: 3 or 4 are typical
  for (int step = 0; step <= max_steps; ++step) {
    const TurnedHead turned(head, readings);
    const Eigen::Vector3d point_in_cam = turned.point_in_cam(point_in_world);
    const double along = point_in_cam.dot(ray);
    if (!(along > 0.0)) return std::nullopt;
    const Eigen::Vector2d offset = across.transpose() * point_in_cam / along;
    // 10⁻¹¹ of the distance is a millionth of a pixel of any camera.
    if (offset.norm() < 1e-13 || (step == max_steps && offset.norm() < 1e-11)) return readings;
    const Eigen::Matrix<double, 3, 2> J = turned.J_point_readings(point_in_cam);
    const Eigen::Matrix2d J_offset = (across.transpose() * J - offset * (ray.transpose() * J)) / along;
    if (!(std::abs(J_offset.determinant()) > 1e-12)) return std::nullopt;
    readings -= J_offset.inverse() * offset;
  }
  return std::nullopt;
}

Eigen::Matrix<double, 3, 4> projection_matrix(const RigHead& rig_head, const Eigen::Vector2d& pan_tilt_rad) {
  const std::vector<std::string> names = param_names(rig_head.camera.lens);
  const Eigen::VectorXd values = params(rig_head.camera.lens);
  const auto value = [&](const char* name) {
    const auto at = std::find(names.begin(), names.end(), name);
    return at == names.end() ? 0.0 : values[at - names.begin()];
  };
  Eigen::Matrix3d K;
  K << value("fx"), value("skew"), value("cx"), 0.0, value("fy"), value("cy"), 0.0, 0.0, 1.0;
  const TurnedHead turned(rig_head.head, pan_tilt_rad);
  Eigen::Matrix<double, 3, 4> M;
  M << K * turned.cam_from_world_rotation, K * turned.cam_from_world_translation;
  return M;
}

std::array<RigHead, 2> xiahou_rig() {
  Camera camera{320, 240, Calibrated<Pinhole>{}, {}, 0.0, "Xiahou, Chen & Wu, 2015"};
  camera.lens = with_params(camera.lens, Eigen::Vector<double, 5>(337.84, 337.84, 160.0, 120.0, 0.0));
  std::array<RigHead, 2> rig{RigHead{{}, camera}, RigHead{{}, camera}};
  rig[0].head.id = 1;
  rig[1].head.id = 2;
  rig[1].head.world_from_base.translation.x() = 0.50;
  return rig;
}

}  // namespace alidade
