#include "alidade/camera/port_residual.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/camera/projection_sigma.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

struct Observation {
  Eigen::Vector2d px;
  Eigen::Vector3d point_in_cam;
};

/// What the port sees at depth `range_m`, over the image.
std::vector<Observation> observations_at(const Camera& port, const PortResidualConfig& config, double range_m) {
  const PixelGrid grid = make_grid(port.width_px, port.height_px, config.cols, config.rows);
  std::vector<Observation> observations;
  for (int row = 0; row < grid.rows; ++row) {
    for (int col = 0; col < grid.cols; ++col) {
      const auto ray = observation_ray(port, grid.px(col, row));
      if (!ray || !(ray->direction_in_cam.z() > 0.0)) continue;
      const double distance_m = (range_m - ray->origin_in_cam.z()) / ray->direction_in_cam.z();
      if (!(distance_m > 0.0)) continue;
      observations.push_back({grid.px(col, row), ray->origin_in_cam + distance_m * ray->direction_in_cam});
    }
  }
  return observations;
}

/// Brown parameters without skew, then the viewpoint.
constexpr int num_free = Brown::num_params - 1 + 3;
using Step = Eigen::Matrix<double, num_free, 1>;

struct Fit {
  Params<Brown> lens;
  Eigen::Vector3d viewpoint = Eigen::Vector3d::Zero();

  [[nodiscard]] Fit moved(const Step& step) const {
    Fit next = *this;
    next.lens.head<4>() += step.head<4>();
    next.lens.tail<5>() += step.segment<5>(4);
    next.viewpoint += step.tail<3>();
    return next;
  }
};

/// Normal equations; infinite cost where a point is not seen.
struct Equations {
  Eigen::Matrix<double, num_free, num_free> H = Eigen::Matrix<double, num_free, num_free>::Zero();
  Step gradient = Step::Zero();
  double cost = 0.0;
};

Equations linearize(const Fit& fit, const std::vector<Observation>& observations) {
  Equations eq;
  const Brown::Domain domain = Brown::domain(fit.lens);
  for (const Observation& observation : observations) {
    const auto seen = Brown::project_with_jacobians(fit.lens, domain, observation.point_in_cam - fit.viewpoint);
    if (!seen) {
      eq.cost = std::numeric_limits<double>::infinity();
      return eq;
    }
    Eigen::Matrix<double, 2, num_free> J;
    J << seen->J_px_params.leftCols<4>(), seen->J_px_params.rightCols<5>(), -seen->J_px_point;
    const Eigen::Vector2d residual = seen->px - observation.px;
    eq.H += J.transpose() * J;
    eq.gradient += J.transpose() * residual;
    eq.cost += residual.squaredNorm();
  }
  return eq;
}

/// Levenberg–Marquardt.
std::optional<Fit> fit_brown(Fit fit, const std::vector<Observation>& observations) {
  Equations eq = linearize(fit, observations);
  if (observations.size() < num_free || !std::isfinite(eq.cost)) return std::nullopt;
  double lambda = 1e-6;
  constexpr int max_iterations = 100;
  for (int i = 0; i < max_iterations && lambda < 1e9; ++i) {
    Eigen::Matrix<double, num_free, num_free> H = eq.H;
    H.diagonal() *= 1.0 + lambda;
    const Step step = -solve_symmetric(H, eq.gradient);
    const Fit next = fit.moved(step);
    const Equations trial = linearize(next, observations);
    if (!step.allFinite() || !(trial.cost <= eq.cost)) {
      lambda = std::max(10.0 * lambda, 1e-6);
      continue;
    }
    const bool done = eq.cost - trial.cost <= 1e-10 * eq.cost + 1e-12 * static_cast<double>(observations.size());
    fit = next;
    eq = trial;
    lambda *= 0.1;
    if (done && lambda <= 1e-3) return fit;
  }
  return std::nullopt;
}

/// The lens in air, its focal lengths as water stretches them; the distortion is left to the fit.
Fit start_of(const Params<FlatPort>& port) {
  Fit fit{Params<Brown>::Zero(), Eigen::Vector3d::Zero()};
  fit.lens.head<5>() = port.head<5>();
  fit.lens.head<2>() *= port[13];  // n_water
  return fit;
}

PortRange compare(const Camera& brown, const Eigen::Vector3d& viewpoint, const std::vector<Observation>& observations,
                  double range_m) {
  PortRange at{range_m, 0.0, 0.0};
  double count = 0.0;
  for (const Observation& observation : observations) {
    const auto px = project(brown, observation.point_in_cam - viewpoint);
    if (!px) continue;
    const double off = (*px - observation.px).norm();
    at.rms_px += off * off;
    at.max_px = std::max(at.max_px, off);
    count += 1.0;
  }
  at.rms_px = count > 0.0 ? std::sqrt(at.rms_px / count) : std::nan("");
  return at;
}

}  // namespace

std::optional<PortResidual> port_residual(const Camera& port, const PortResidualConfig& config) {
  const auto* lens = std::get_if<Calibrated<FlatPort>>(&port.lens);
  if (!lens) return std::nullopt;
  std::vector<Observation> observations;
  for (const double range_m : config.fit_ranges_m) {
    const std::vector<Observation> at = observations_at(port, config, range_m);
    observations.insert(observations.end(), at.begin(), at.end());
  }
  const std::optional<Fit> fit = fit_brown(start_of(lens->params), observations);
  if (!fit) return std::nullopt;
  PortResidual result;
  result.brown = {port.width_px, port.height_px, Calibrated<Brown>{fit->lens}, {}, 0.0, "fitted to a flat port"};
  result.shift_m = fit->viewpoint;
  constexpr double near_m = 0.5;
  for (const double range_m : config.test_ranges_m) {
    result.at.push_back(compare(result.brown, fit->viewpoint, observations_at(port, config, range_m), range_m));
    const double rms_px = result.at.back().rms_px;
    if (range_m >= near_m && !(rms_px <= result.worst_rms_px)) result.worst_rms_px = rms_px;
  }
  result.brown_is_enough = result.worst_rms_px <= port_residual_limit_px;
  return result;
}

}  // namespace alidade
