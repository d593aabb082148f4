#include "alidade/camera/flat_port.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

enum : Eigen::Index { gap = 10, glass, n_glass, n_water, normal_x, normal_y };

/// Whether the parameters describe a port at all: also false for what is not finite.
bool is_port(const Params<FlatPort>& p) {
  const auto is_index = [](double n) { return n >= 1.0 && n <= 4.0; };
  constexpr double max_m = 1e6;
  return p[gap] > FlatPort::min_gap_m && p[gap] < max_m && p[glass] >= 0.0 && p[glass] < max_m &&
         is_index(p[n_glass]) && is_index(p[n_water]) && p[normal_x] * p[normal_x] + p[normal_y] * p[normal_y] < 1.0;
}

/// tan of the angle in a medium of index n where it is τ in air, with its derivatives: τ Q^−½, Q = n² + (n² − 1) τ².
struct Refracted {
  double tan, by_tau, by_n;
};

Refracted refract(double tau, double n) {
  const double n2 = n * n, Q = n2 + (n2 - 1.0) * tau * tau, root = std::sqrt(Q);
  return {tau / root, n2 / (Q * root), -n * tau * (1.0 + tau * tau) / (Q * root)};
}

/// A point in the axial frame of the port, and the τ that sees it, with its derivatives.
struct Axial {
  Eigen::Vector3d normal, across;  // across: unit, from the axis to the point; zero on the axis
  double z = 0.0, rho = 0.0;
  double tau = 0.0, ratio = 0.0;  // ratio: τ/ρ, also on the axis
  double by_rho = 0.0, by_z = 0.0, by_gap = 0.0, by_glass = 0.0, by_n_glass = 0.0, by_n_water = 0.0;
};

/// Newton from below the root never leaves it, as the right side is concave. None where nothing in air sees that far
/// aside: a lens on the glass sees no further than total reflection lets it.
std::optional<double> solve_tau(const Params<FlatPort>& p, double water_m, double rho) {
  const double n2 = p[n_water] * p[n_water];
  const double slope0 = p[gap] + p[glass] / p[n_glass] + water_m / p[n_water];
  if (!(slope0 > 0.0)) return std::nullopt;
  const double depth = p[gap] + p[glass] + water_m;
  double tau = rho / slope0;  // the tangent at τ = 0: below the root
  if (const double s2 = n2 * rho * rho / (rho * rho + depth * depth); s2 < 0.8) {
    tau = std::sqrt(s2 / (1.0 - s2));  // as if all were water: nearer, maybe above; the next step is below again
  }
  constexpr int max_iterations = 60;
  bool last = false;
  for (int i = 0; i < max_iterations; ++i) {
    const Refracted in_glass = refract(tau, p[n_glass]), in_water = refract(tau, p[n_water]);
    const double off = p[gap] * tau + p[glass] * in_glass.tan + water_m * in_water.tan - rho;
    const double slope = p[gap] + p[glass] * in_glass.by_tau + water_m * in_water.by_tau;
    const double step = off / slope;
    if (!(slope > 0.0) || !std::isfinite(step)) return std::nullopt;
    tau = std::max(0.0, tau - step);
    if (last) return tau;
    last = std::abs(step) <= 1e-7 * (1.0 + tau);  // its square is below rounding: one more step ends here
  }
  return std::nullopt;
}

std::optional<Axial> axial(const Params<FlatPort>& p, const Eigen::Vector3d& point_in_cam) {
  if (!is_port(p) || !std::isfinite(point_in_cam.squaredNorm())) return std::nullopt;
  Axial at;
  at.normal = FlatPort::normal(p);
  at.z = at.normal.dot(point_in_cam);
  const double water_m = at.z - p[gap] - p[glass];
  if (!(water_m > 0.0)) return std::nullopt;
  const Eigen::Vector3d aside = point_in_cam - at.z * at.normal;
  at.rho = aside.norm();
  at.across = at.rho > 0.0 ? Eigen::Vector3d(aside / at.rho) : Eigen::Vector3d::Zero();
  const std::optional<double> tau = solve_tau(p, water_m, at.rho);
  if (!tau) return std::nullopt;
  at.tau = *tau;
  const Refracted in_glass = refract(*tau, p[n_glass]), in_water = refract(*tau, p[n_water]);
  const double slope = p[gap] + p[glass] * in_glass.by_tau + water_m * in_water.by_tau;
  at.by_rho = 1.0 / slope;
  at.ratio = at.rho > 0.0 ? *tau / at.rho : at.by_rho;
  at.by_z = -in_water.tan / slope;
  at.by_gap = (in_water.tan - *tau) / slope;
  at.by_glass = (in_water.tan - in_glass.tan) / slope;
  at.by_n_glass = -p[glass] * in_glass.by_n / slope;
  at.by_n_water = -water_m * in_water.by_n / slope;
  return at;
}

Eigen::Vector3d air_direction(const Axial& at) { return at.normal + at.tau * at.across; }

/// Derivative of the air direction n + τ e by the point, e the unit vector across: τ/ρ (I − n nᵀ − e eᵀ) + e dτ.
Eigen::Matrix3d air_by_point(const Axial& at) {
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  return at.ratio * (I - at.normal * at.normal.transpose()) +
         at.across * ((at.by_rho - at.ratio) * at.across + at.by_z * at.normal).transpose();
}

/// The same by the normal moving by dn, which is across n: dz = ρ e·dn, dρ = −z e·dn.
Eigen::Vector3d air_by_normal(const Axial& at, const Eigen::Vector3d& dn) {
  const double along = at.across.dot(dn), dz = at.rho * along, drho = -at.z * along;
  return dn - at.ratio * (dz * at.normal + at.z * dn) + at.across * ((at.by_rho - at.ratio) * drho + at.by_z * dz);
}

}  // namespace

Eigen::Vector3d FlatPort::normal(const Params<FlatPort>& p) {
  const double x = p[normal_x], y = p[normal_y];
  return {x, y, std::sqrt(1.0 - x * x - y * y)};
}

Params<Brown> FlatPort::air_lens(const Params<FlatPort>& p) { return p.head<Brown::num_params>(); }

FlatPort::Domain FlatPort::domain(const Params<FlatPort>& params) { return Brown::domain(air_lens(params)); }

std::optional<Eigen::Vector2d> FlatPort::project(const Params<FlatPort>& params, const Domain& domain,
                                                 const Eigen::Vector3d& point_in_cam) {
  const std::optional<Axial> at = axial(params, point_in_cam);
  if (!at) return std::nullopt;
  return Brown::project(air_lens(params), domain, air_direction(*at));
}

std::optional<Projection<FlatPort>> FlatPort::project_with_jacobians(const Params<FlatPort>& params,
                                                                     const Domain& domain,
                                                                     const Eigen::Vector3d& point_in_cam) {
  const std::optional<Axial> at = axial(params, point_in_cam);
  if (!at) return std::nullopt;
  const auto in_air = Brown::project_with_jacobians(air_lens(params), domain, air_direction(*at));
  if (!in_air) return std::nullopt;
  Projection<FlatPort> out{in_air->px, in_air->J_px_point * air_by_point(*at), {}};
  out.J_px_params.leftCols<Brown::num_params>() = in_air->J_px_params;
  const Eigen::Vector2d J_px_tau = in_air->J_px_point * at->across;
  out.J_px_params.col(gap) = J_px_tau * at->by_gap;
  out.J_px_params.col(glass) = J_px_tau * at->by_glass;
  out.J_px_params.col(n_glass) = J_px_tau * at->by_n_glass;
  out.J_px_params.col(n_water) = J_px_tau * at->by_n_water;
  const Eigen::Vector3d& n = at->normal;
  out.J_px_params.col(normal_x) = in_air->J_px_point * air_by_normal(*at, {1.0, 0.0, -n.x() / n.z()});
  out.J_px_params.col(normal_y) = in_air->J_px_point * air_by_normal(*at, {0.0, 1.0, -n.y() / n.z()});
  if (!out.J_px_point.allFinite() || !out.J_px_params.allFinite()) return std::nullopt;
  return out;
}

std::optional<ObservationRay> FlatPort::observation_ray(const Params<FlatPort>& params, const Domain& domain,
                                                        const Eigen::Vector2d& px) {
  if (!is_port(params)) return std::nullopt;
  const auto in_air = Brown::unproject(air_lens(params), domain, px);
  if (!in_air) return std::nullopt;
  const Eigen::Vector3d n = normal(params);
  const double along = n.dot(*in_air);
  if (!(along > 0.0)) return std::nullopt;            // looks past the port
  const Eigen::Vector3d aside = *in_air / along - n;  // τ e
  const double tau = aside.norm();
  const Eigen::Vector3d across = tau > 0.0 ? Eigen::Vector3d(aside / tau) : Eigen::Vector3d::Zero();
  const double in_glass = refract(tau, params[n_glass]).tan, in_water = refract(tau, params[n_water]).tan;
  return ObservationRay{(params[gap] + params[glass]) * n + (params[gap] * tau + params[glass] * in_glass) * across,
                        (n + in_water * across).normalized()};
}

std::optional<Eigen::Vector3d> FlatPort::unproject(const Params<FlatPort>& params, const Domain& domain,
                                                   const Eigen::Vector2d& px) {
  const std::optional<ObservationRay> ray = observation_ray(params, domain, px);
  if (!ray) return std::nullopt;
  return ray->direction_in_cam;
}

// Without a domain: the lens' own fold is looked for once a point.
std::optional<Eigen::Vector2d> FlatPort::project(const Params<FlatPort>& params, const Eigen::Vector3d& point_in_cam) {
  return project(params, domain(params), point_in_cam);
}

std::optional<Projection<FlatPort>> FlatPort::project_with_jacobians(const Params<FlatPort>& params,
                                                                     const Eigen::Vector3d& point_in_cam) {
  return project_with_jacobians(params, domain(params), point_in_cam);
}

std::optional<Eigen::Vector3d> FlatPort::unproject(const Params<FlatPort>& params, const Eigen::Vector2d& px) {
  return unproject(params, domain(params), px);
}

}  // namespace alidade
