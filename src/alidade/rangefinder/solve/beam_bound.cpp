#include "alidade/rangefinder/solve/beam_bound.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

void put_geometry(const BeamProblem& problem, const Beam& beam, BeamBound& bound) {
  double nearest_m = infinity, farthest_m = 0.0;
  Eigen::Matrix3d outer = Eigen::Matrix3d::Zero();
  double num_planes = 0.0;
  for (const PreparedShot& shot : problem.shots) {
    if (!shot.used) continue;
    nearest_m = std::min(nearest_m, shot.range_m);
    farthest_m = std::max(farthest_m, shot.range_m);
    if (!shot.plane) continue;
    outer += shot.plane->normal_in_cam * shot.plane->normal_in_cam.transpose();
    num_planes += 1.0;
  }
  bound.nearest_m = farthest_m > 0.0 ? nearest_m : 0.0;
  bound.farthest_m = farthest_m;
  bound.range_ratio = farthest_m > 0.0 ? farthest_m / nearest_m : 0.0;
  if (num_planes > 0.0) {
    bound.normal_spread = std::sqrt(std::max(0.0, symmetric_eigen3(outer / num_planes).values[0]));
  }
  bound.offset_m = offset_of_line_m(beam);
}

}  // namespace

double scaled_condition(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return infinity;
  const Eigen::VectorXd values = symmetric_eigenvalues(scale.asDiagonal() * information * scale.asDiagonal());
  const double least = values[0];
  return least > 0.0 ? values[values.size() - 1] / least : infinity;
}

BeamBound judge_beam(const BeamProblem& problem, const Beam& beam, const Camera& camera) {
  BeamBound bound;
  put_geometry(problem, beam, bound);
  bound.condition = infinity;
  if (const auto normals = beam_normals(problem, camera, beam))
    bound.condition = scaled_condition(normals->H.topLeftCorner(problem.num_free(), problem.num_free()));
  bound.sigma_origin_m = std::sqrt(beam.cov.topLeftCorner<3, 3>().trace());
  bound.sigma_direction_rad = std::sqrt(beam.cov.block<2, 2>(beam_direction_param, beam_direction_param).trace());
  const auto spot_sigma_px = [&](double range_m) {
    const auto pixel = measured_pixel(beam, camera, range_m, 0.0);
    return pixel ? std::sqrt(std::max(0.0, symmetric_eigenvalues(pixel->cov)[1])) : infinity;  // not seen there
  };
  for (std::size_t i = 0; i < bound_ranges_m.size(); ++i) {
    bound.spot_sigma_px[i] = spot_sigma_px(bound_ranges_m[i]);
    if (!(bound.nearest_m > 0.0)) continue;
    const double where_m = std::clamp(bound_ranges_m[i], bound.nearest_m, bound.farthest_m);
    bound.worst_spot_sigma_px = std::max(bound.worst_spot_sigma_px, spot_sigma_px(where_m));
  }
  return bound;
}

Eigen::MatrixXd inverse_of_scaled(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  return scale.asDiagonal() * inverse_symmetric(scale.asDiagonal() * information * scale.asDiagonal()) *
         scale.asDiagonal();
}

}  // namespace alidade
