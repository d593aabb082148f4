#include "alidade/camera/pinhole.h"

#include <cmath>

namespace alidade {
namespace {

/// The normalised point, or none behind the camera or too far away to be squared.
std::optional<Eigen::Vector2d> normalized(const Eigen::Vector3d& point_in_cam) {
  if (!(point_in_cam.z() > 0.0) || !std::isfinite(point_in_cam.squaredNorm())) return std::nullopt;
  return Eigen::Vector2d(point_in_cam.head<2>() / point_in_cam.z());
}

Eigen::Vector2d to_px(const Params<Pinhole>& p, const Eigen::Vector2d& m) {
  return {p[0] * m.x() + p[4] * m.y() + p[2], p[1] * m.y() + p[3]};
}

}  // namespace

Pinhole::Domain Pinhole::domain(const Params<Pinhole>&) { return {}; }

std::optional<Eigen::Vector2d> Pinhole::project(const Params<Pinhole>& params, const Eigen::Vector3d& point_in_cam) {
  const std::optional<Eigen::Vector2d> m = normalized(point_in_cam);
  if (!m) return std::nullopt;
  const Eigen::Vector2d px = to_px(params, *m);
  if (!px.allFinite()) return std::nullopt;
  return px;
}

std::optional<Projection<Pinhole>> Pinhole::project_with_jacobians(const Params<Pinhole>& params,
                                                                   const Eigen::Vector3d& point_in_cam) {
  const std::optional<Eigen::Vector2d> px = project(params, point_in_cam);
  if (!px) return std::nullopt;
  const double inverse_z = 1.0 / point_in_cam.z();
  const double x = point_in_cam.x() * inverse_z, y = point_in_cam.y() * inverse_z;
  Projection<Pinhole> out{*px, {}, {}};
  out.J_px_point << params[0], params[4], -(params[0] * x + params[4] * y), 0.0, params[1], -params[1] * y;
  out.J_px_point *= inverse_z;
  out.J_px_params << x, 0.0, 1.0, 0.0, y, 0.0, y, 0.0, 1.0, 0.0;
  if (!out.J_px_point.allFinite()) return std::nullopt;
  return out;
}

std::optional<Eigen::Vector3d> Pinhole::unproject(const Params<Pinhole>& params, const Eigen::Vector2d& px) {
  const double y = (px.y() - params[3]) / params[1];
  const double x = (px.x() - params[2] - params[4] * y) / params[0];
  if (!std::isfinite(x * x + y * y)) return std::nullopt;
  return Eigen::Vector3d(x, y, 1.0).normalized();
}

std::optional<Eigen::Vector2d> Pinhole::project(const Params<Pinhole>& params, const Domain&,
                                                const Eigen::Vector3d& point_in_cam) {
  return project(params, point_in_cam);
}

std::optional<Projection<Pinhole>> Pinhole::project_with_jacobians(const Params<Pinhole>& params, const Domain&,
                                                                   const Eigen::Vector3d& point_in_cam) {
  return project_with_jacobians(params, point_in_cam);
}

std::optional<Eigen::Vector3d> Pinhole::unproject(const Params<Pinhole>& params, const Domain&,
                                                  const Eigen::Vector2d& px) {
  return unproject(params, px);
}

}  // namespace alidade
