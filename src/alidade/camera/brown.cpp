#include "alidade/camera/brown.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/camera/radial_fold.h"

namespace alidade {
namespace {

enum : Eigen::Index { fx, fy, cx, cy, skew, k1, k2, p1, p2, k3 };

/// Coefficients of d(rL)/dr in r².
std::array<double, 3> slope_coefficients(const Params<Brown>& p) { return {3.0 * p[k1], 5.0 * p[k2], 7.0 * p[k3]}; }

/// The distorted normalised point with its (symmetric) derivative [a b; b c].
struct Distorted {
  Eigen::Vector2d m;
  double a, b, c;
  [[nodiscard]] double det() const { return a * c - b * b; }
};

Distorted distort(const Params<Brown>& p, double x, double y) {
  const double r2 = x * x + y * y;
  const double L = 1.0 + r2 * (p[k1] + r2 * (p[k2] + r2 * p[k3]));
  const double D = 2.0 * (p[k1] + r2 * (2.0 * p[k2] + r2 * 3.0 * p[k3]));  // dL/dx = D x, dL/dy = D y
  return {{L * x + 2.0 * p[p1] * x * y + p[p2] * (r2 + 2.0 * x * x),
           L * y + p[p1] * (r2 + 2.0 * y * y) + 2.0 * p[p2] * x * y},
          L + D * x * x + 2.0 * p[p1] * y + 6.0 * p[p2] * x,
          D * x * y + 2.0 * p[p1] * x + 2.0 * p[p2] * y,
          L + D * y * y + 6.0 * p[p1] * y + 2.0 * p[p2] * x};
}

Eigen::Vector2d to_px(const Params<Brown>& p, const Eigen::Vector2d& m) {
  return {p[fx] * m.x() + p[skew] * m.y() + p[cx], p[fy] * m.y() + p[cy]};
}

bool is_in_front(const Eigen::Vector3d& point_in_cam) {
  return point_in_cam.z() > 0.0 && std::isfinite(point_in_cam.squaredNorm());
}

/// The domain as far as a single point needs it: the fold is looked for only where the point could be beyond it.
Brown::Domain domain_for(const Params<Brown>& params, const Eigen::Vector3d& point_in_cam) {
  const double r2 = point_in_cam.head<2>().squaredNorm() / (point_in_cam.z() * point_in_cam.z());
  const auto slope = slope_coefficients(params);
  if (detail::is_surely_positive(slope, r2)) return {std::numeric_limits<double>::infinity()};
  return {detail::first_root(slope)};
}

/// Radius r with r L(r²) = target; just inside the fold where the map does not reach it. A start, not an answer.
double undistorted_radius(const Params<Brown>& p, const Brown::Domain& domain, double target) {
  const auto map = [&](double r) { return r * (1.0 + r * r * (p[k1] + r * r * (p[k2] + r * r * p[k3]))); };
  double low = 0.0, high = std::isfinite(domain.max_radius2) ? 0.999 * std::sqrt(domain.max_radius2) : 1.0;
  if (!std::isfinite(domain.max_radius2)) {
    while (map(high) < target && high < 1e12) high *= 2.0;
  }
  if (!(map(high) > target)) return high;
  double r = std::min(target, high);
  for (int i = 0; i < 60; ++i) {
    const double error = map(r) - target, r2 = r * r;
    if (std::abs(error) < 1e-6 * (1.0 + target)) break;  // the two-dimensional Newton takes over from here
    (error > 0.0 ? high : low) = r;
    const double next = r - error / (1.0 + r2 * (3.0 * p[k1] + r2 * (5.0 * p[k2] + r2 * 7.0 * p[k3])));
    r = next > low && next < high ? next : 0.5 * (low + high);
  }
  return r;
}

/// Normalised point whose distorted image is `target`, in the valid domain.
std::optional<Eigen::Vector2d> undistort(const Params<Brown>& p, const Brown::Domain& domain,
                                         const Eigen::Vector2d& target) {
  const double target_norm = target.norm();
  if (target_norm == 0.0 && p[p1] == 0.0 && p[p2] == 0.0) return Eigen::Vector2d(0.0, 0.0);
  const double start = undistorted_radius(p, domain, target_norm);
  Eigen::Vector2d m = target_norm > 0.0 ? Eigen::Vector2d(target * (start / target_norm)) : Eigen::Vector2d(0.0, 0.0);
  constexpr int max_iterations = 40;  // quadratic: 2–4 are typical; linear on the fold itself
  for (int i = 0; i < max_iterations; ++i) {
    const Distorted d = distort(p, m.x(), m.y());
    const Eigen::Vector2d error = d.m - target;
    if (!(d.det() > 0.0)) return std::nullopt;
    Eigen::Vector2d step(-(d.c * error.x() - d.b * error.y()) / d.det(),
                         -(d.a * error.y() - d.b * error.x()) / d.det());
    const double limit = 0.2 * (1.0 + m.norm());  // a full step near the fold would jump over it
    if (step.norm() > limit) step *= limit / step.norm();
    constexpr double small = 1e-8;  // its square is below rounding: where the map is no fold, one step of it ends here
    const bool is_last = step.norm() <= (d.det() > 0.1 ? small : 1e-15) * (1.0 + m.norm());
    // Never leave the sheet that contains the axis.
    for (int halvings = 0; !is_last && halvings < 30; ++halvings, step *= 0.5) {
      const Eigen::Vector2d next = m + step;
      if (next.squaredNorm() < domain.max_radius2 && distort(p, next.x(), next.y()).det() > 0.0) break;
    }
    m += step;
    if (is_last) break;
  }
  const Distorted d = distort(p, m.x(), m.y());
  const bool converged = (d.m - target).norm() <= 1e-13 * (1.0 + target_norm);
  if (!converged || !(m.squaredNorm() < domain.max_radius2) || !(d.det() > 0.0)) return std::nullopt;
  return m;
}

}  // namespace

double Brown::max_radius(const Params<Brown>& params) { return std::sqrt(domain(params).max_radius2); }

Brown::Domain Brown::domain(const Params<Brown>& params) { return {detail::first_root(slope_coefficients(params))}; }

std::optional<Eigen::Vector2d> Brown::project(const Params<Brown>& params, const Domain& domain,
                                              const Eigen::Vector3d& point_in_cam) {
  if (!is_in_front(point_in_cam)) return std::nullopt;
  const double x = point_in_cam.x() / point_in_cam.z(), y = point_in_cam.y() / point_in_cam.z();
  if (!(x * x + y * y < domain.max_radius2)) return std::nullopt;
  const Distorted d = distort(params, x, y);
  const Eigen::Vector2d px = to_px(params, d.m);
  if (!(d.det() > 0.0) || !px.allFinite()) return std::nullopt;
  return px;
}

std::optional<Projection<Brown>> Brown::project_with_jacobians(const Params<Brown>& params, const Domain& domain,
                                                               const Eigen::Vector3d& point_in_cam) {
  if (!is_in_front(point_in_cam)) return std::nullopt;
  const double inverse_z = 1.0 / point_in_cam.z();
  const double x = point_in_cam.x() / point_in_cam.z(), y = point_in_cam.y() / point_in_cam.z();
  const double r2 = x * x + y * y;
  if (!(r2 < domain.max_radius2)) return std::nullopt;
  const Distorted d = distort(params, x, y);
  if (!(d.det() > 0.0)) return std::nullopt;
  const double f = params[fx], g = params[fy], s = params[skew];

  Projection<Brown> out{to_px(params, d.m), {}, {}};
  const Eigen::Matrix2d J_px_normalized =
      (Eigen::Matrix2d() << f * d.a + s * d.b, f * d.b + s * d.c, g * d.b, g * d.c).finished();
  out.J_px_point.leftCols<2>() = J_px_normalized * inverse_z;
  out.J_px_point.col(2) = J_px_normalized * Eigen::Vector2d(-x * inverse_z, -y * inverse_z);

  const double r4 = r2 * r2, r6 = r4 * r2, xy2 = 2.0 * x * y;
  const double p1y = r2 + 2.0 * y * y, p2x = r2 + 2.0 * x * x;
  out.J_px_params.row(0) << d.m.x(), 0.0, 1.0, 0.0, d.m.y(), (f * x + s * y) * r2, (f * x + s * y) * r4,
      f * xy2 + s * p1y, f * p2x + s * xy2, (f * x + s * y) * r6;
  out.J_px_params.row(1) << 0.0, d.m.y(), 0.0, 1.0, 0.0, g * y * r2, g * y * r4, g * p1y, g * xy2, g * y * r6;
  if (!out.px.allFinite() || !out.J_px_point.allFinite() || !out.J_px_params.allFinite()) return std::nullopt;
  return out;
}

std::optional<Eigen::Vector3d> Brown::unproject(const Params<Brown>& params, const Domain& domain,
                                                const Eigen::Vector2d& px) {
  const double y = (px.y() - params[cy]) / params[fy];
  const double x = (px.x() - params[cx] - params[skew] * y) / params[fx];
  if (!std::isfinite(x * x + y * y)) return std::nullopt;
  const std::optional<Eigen::Vector2d> m = undistort(params, domain, {x, y});
  if (!m) return std::nullopt;
  return Eigen::Vector3d(m->x(), m->y(), 1.0).normalized();
}

std::optional<Eigen::Vector2d> Brown::project(const Params<Brown>& params, const Eigen::Vector3d& point_in_cam) {
  return project(params, domain_for(params, point_in_cam), point_in_cam);
}

std::optional<Projection<Brown>> Brown::project_with_jacobians(const Params<Brown>& params,
                                                               const Eigen::Vector3d& point_in_cam) {
  return project_with_jacobians(params, domain_for(params, point_in_cam), point_in_cam);
}

std::optional<Eigen::Vector3d> Brown::unproject(const Params<Brown>& params, const Eigen::Vector2d& px) {
  return unproject(params, domain(params), px);
}

}  // namespace alidade
