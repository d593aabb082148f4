#include "alidade/camera/kannala_brandt.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/camera/radial_fold.h"

namespace alidade {
namespace {

enum : Eigen::Index { fx, fy, cx, cy, skew, k1, k2, k3, k4 };
constexpr double pi = std::numbers::pi;

/// θ_d and its derivative.
struct Radial {
  double value, slope;
};

Radial radial(const Params<KannalaBrandt>& p, double theta) {
  const double t = theta * theta;
  return {theta * (1.0 + t * (p[k1] + t * (p[k2] + t * (p[k3] + t * p[k4])))),
          1.0 + t * (3.0 * p[k1] + t * (5.0 * p[k2] + t * (7.0 * p[k3] + t * 9.0 * p[k4])))};
}

std::array<double, 4> slope_coefficients(const Params<KannalaBrandt>& p) {
  return {3.0 * p[k1], 5.0 * p[k2], 7.0 * p[k3], 9.0 * p[k4]};
}

/// A point as the model sees it: its angle off the axis and s = θ_d/ρ, exact in the limit on the axis.
struct OffAxis {
  double rho, theta, scale, slope;
  Eigen::Vector2d direction;  ///< (X, Y)/ρ; any unit vector on the axis, where it does not matter.
};

std::optional<OffAxis> off_axis(const Params<KannalaBrandt>& params, const KannalaBrandt::Domain& domain,
                                const Eigen::Vector3d& point_in_cam) {
  if (!std::isfinite(point_in_cam.squaredNorm())) return std::nullopt;
  const double z = point_in_cam.z(), rho = std::hypot(point_in_cam.x(), point_in_cam.y());
  if (rho < 1e-150) {  // ρ² has no digits left: take the limit. On the axis behind the camera there is no direction.
    if (!(z > 0.0 && domain.max_angle > 0.0)) return std::nullopt;
    return OffAxis{rho, 0.0, 1.0 / z, 1.0, Eigen::Vector2d::UnitX()};
  }
  const double theta = std::atan2(rho, z);
  if (!(theta < domain.max_angle)) return std::nullopt;
  const Radial r = radial(params, theta);
  return OffAxis{rho, theta, r.value / rho, r.slope, point_in_cam.head<2>() / rho};
}

Eigen::Vector2d to_px(const Params<KannalaBrandt>& p, const Eigen::Vector2d& m) {
  return {p[fx] * m.x() + p[skew] * m.y() + p[cx], p[fy] * m.y() + p[cy]};
}

/// The domain as far as a single point needs it.
KannalaBrandt::Domain domain_for(const Params<KannalaBrandt>& params, const Eigen::Vector3d& point_in_cam) {
  const double theta = std::atan2(point_in_cam.head<2>().norm(), point_in_cam.z());
  if (detail::is_surely_positive(slope_coefficients(params), theta * theta)) return {pi};
  return KannalaBrandt::domain(params);
}

/// Angle with θ_d(θ) = target below the fold: the map is monotone there, so Newton is kept inside a bracket.
std::optional<double> angle_of(const Params<KannalaBrandt>& params, double max_angle, double target) {
  double low = 0.0, high = max_angle;
  if (!(radial(params, high).value > target)) return std::nullopt;
  double theta = std::min(target, 0.5 * high);
  for (int i = 0; i < 100; ++i) {  // 4–6 are typical
    const Radial r = radial(params, theta);
    const double error = r.value - target;
    (error > 0.0 ? high : low) = theta;
    double next = theta - error / r.slope;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const bool done = std::abs(next - theta) <= 2e-16 * theta;
    theta = next;
    if (done) break;
  }
  if (!(std::abs(radial(params, theta).value - target) <= 1e-13 * (1.0 + target))) return std::nullopt;
  return theta;
}

}  // namespace

double KannalaBrandt::max_angle(const Params<KannalaBrandt>& params) {
  return std::min(pi, std::sqrt(detail::first_root(slope_coefficients(params))));
}

KannalaBrandt::Domain KannalaBrandt::domain(const Params<KannalaBrandt>& params) { return {max_angle(params)}; }

std::optional<Eigen::Vector2d> KannalaBrandt::project(const Params<KannalaBrandt>& params, const Domain& domain,
                                                      const Eigen::Vector3d& point_in_cam) {
  const std::optional<OffAxis> at = off_axis(params, domain, point_in_cam);
  if (!at) return std::nullopt;
  const Eigen::Vector2d px = to_px(params, at->scale * point_in_cam.head<2>());
  if (!px.allFinite()) return std::nullopt;
  return px;
}

std::optional<Projection<KannalaBrandt>> KannalaBrandt::project_with_jacobians(const Params<KannalaBrandt>& params,
                                                                               const Domain& domain,
                                                                               const Eigen::Vector3d& point_in_cam) {
  const std::optional<OffAxis> at = off_axis(params, domain, point_in_cam);
  if (!at) return std::nullopt;
  const double R2 = point_in_cam.squaredNorm();
  const Eigen::Vector2d m = at->scale * point_in_cam.head<2>();
  // (x_d, y_d) = s (X, Y), s = θ_d/ρ: along the radius the derivative is θ_d' Z/R², across it s.
  const double along = at->slope * point_in_cam.z() / R2;
  Eigen::Matrix<double, 2, 3> J_m_point;
  J_m_point.leftCols<2>() =
      at->scale * Eigen::Matrix2d::Identity() + (along - at->scale) * at->direction * at->direction.transpose();
  J_m_point.col(2) = -at->slope * (at->rho / R2) * at->direction;
  const Eigen::Matrix2d J_px_m = (Eigen::Matrix2d() << params[fx], params[skew], 0.0, params[fy]).finished();

  Projection<KannalaBrandt> out{to_px(params, m), J_px_m * J_m_point, {}};
  out.J_px_params.leftCols<5>() << m.x(), 0.0, 1.0, 0.0, m.y(), 0.0, m.y(), 0.0, 1.0, 0.0;
  Eigen::Vector2d J_px_k = J_px_m * at->direction * at->theta;
  for (Eigen::Index i = k1; i <= k4; ++i) {
    J_px_k *= at->theta * at->theta;
    out.J_px_params.col(i) = J_px_k;
  }
  if (!out.px.allFinite() || !out.J_px_point.allFinite() || !out.J_px_params.allFinite()) return std::nullopt;
  return out;
}

std::optional<Eigen::Vector3d> KannalaBrandt::unproject(const Params<KannalaBrandt>& params, const Domain& domain,
                                                        const Eigen::Vector2d& px) {
  const double y = (px.y() - params[cy]) / params[fy];
  const double x = (px.x() - params[cx] - params[skew] * y) / params[fx];
  const double r = std::hypot(x, y);
  if (!std::isfinite(r)) return std::nullopt;
  if (r == 0.0) return Eigen::Vector3d::UnitZ();
  const std::optional<double> theta = angle_of(params, domain.max_angle, r);
  if (!theta) return std::nullopt;
  return Eigen::Vector3d(std::sin(*theta) * x / r, std::sin(*theta) * y / r, std::cos(*theta));
}

std::optional<Eigen::Vector2d> KannalaBrandt::project(const Params<KannalaBrandt>& params,
                                                      const Eigen::Vector3d& point_in_cam) {
  return project(params, domain_for(params, point_in_cam), point_in_cam);
}

std::optional<Projection<KannalaBrandt>> KannalaBrandt::project_with_jacobians(const Params<KannalaBrandt>& params,
                                                                               const Eigen::Vector3d& point_in_cam) {
  return project_with_jacobians(params, domain_for(params, point_in_cam), point_in_cam);
}

std::optional<Eigen::Vector3d> KannalaBrandt::unproject(const Params<KannalaBrandt>& params,
                                                        const Eigen::Vector2d& px) {
  return unproject(params, domain(params), px);
}

}  // namespace alidade
