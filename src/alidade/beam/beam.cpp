#include "alidade/beam/beam.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "alidade/beam/unit_direction.h"
#include "alidade/geometry/covariance.h"

namespace alidade {

double RangeNoise::sigma_at(double range_m, double tan_incidence) const {
  return std::hypot(sigma_m + per_m * range_m, incidence_m * tan_incidence);
}

Beam Beam::retract(const BeamVector& step) const {
  Beam moved = *this;
  moved.origin_in_cam += step.head<3>();
  moved.direction_in_cam = retract_direction(direction_in_cam, step.segment<2>(3));
  moved.scale += step[5];
  return moved;
}

std::string fault(const Beam& beam) {
  constexpr double off = 1e-6;  // of a unit vector
  const bool is_ray = beam.origin_in_cam.allFinite() && std::abs(beam.direction_in_cam.norm() - 1.0) < off;
  if (!is_ray || !std::isfinite(beam.scale) || beam.scale == 0.0)
    return "a beam has a finite origin, a direction of length one and a scale other than zero";
  if (!beam.cov.allFinite() || !beam.cov_with_lens.allFinite() ||
      (beam.cov_with_lens.size() > 0 && beam.cov_with_lens.rows() != num_beam_params))
    return "the beam's covariance is not finite, or not of its six parameters";
  return is_covariance(beam.cov) ? "" : "the beam's covariance has a negative variance";
}

Eigen::Vector3d point_at(const Beam& beam, double range_m) {
  return beam.origin_in_cam + beam.scale * range_m * beam.direction_in_cam;
}

Eigen::Matrix<double, 3, num_beam_params> J_point_beam(const Beam& beam, double range_m) {
  Eigen::Matrix<double, 3, num_beam_params> J;
  J << Eigen::Matrix3d::Identity(), beam.scale * range_m * tangent_basis(beam.direction_in_cam),
      range_m * beam.direction_in_cam;
  return J;
}

BeamPoint measured_point(const Beam& beam, double range_m, std::optional<double> sigma_range_m) {
  const Eigen::Matrix<double, 3, num_beam_params> J = J_point_beam(beam, range_m);
  const Eigen::Vector3d along =
      beam.scale * sigma_range_m.value_or(beam.noise.sigma_at(range_m)) * beam.direction_in_cam;
  return {point_at(beam, range_m), J * beam.cov * J.transpose() + along * along.transpose()};
}

std::optional<BeamPixel> measured_pixel(const Beam& beam, const Camera& camera, double range_m,
                                        std::optional<double> sigma_range_m) {
  const BeamPoint point = measured_point(beam, range_m, sigma_range_m);
  const auto projection = project_with_jacobians(camera, point.point_in_cam);
  if (!projection) return std::nullopt;
  const Eigen::Matrix<double, 2, 3>& J_px_point = projection->J_px_point;
  BeamPixel pixel{projection->px, J_px_point * point.cov * J_px_point.transpose()};
  const Eigen::Index num_lens = projection->J_px_params.cols();
  if (camera.cov.rows() != num_lens || camera.cov.cols() != num_lens) return pixel;
  pixel.cov += projection->J_px_params * camera.cov * projection->J_px_params.transpose();
  if (beam.cov_with_lens.rows() == num_beam_params && beam.cov_with_lens.cols() == num_lens) {
    const Eigen::Matrix2d cross =
        J_px_point * J_point_beam(beam, range_m) * beam.cov_with_lens * projection->J_px_params.transpose();
    pixel.cov += cross + cross.transpose();
  }
  return pixel;
}

Eigen::Vector2d direction_angles_rad(const Beam& beam) {
  const auto angle = [](double cosine) { return std::acos(std::clamp(cosine, -1.0, 1.0)); };
  return {angle(beam.direction_in_cam.x()), angle(beam.direction_in_cam.y())};
}

Eigen::Matrix<double, 7, 7> embedded_covariance(const Beam& beam) {
  Eigen::Matrix<double, 7, num_beam_params> J = Eigen::Matrix<double, 7, num_beam_params>::Zero();
  J.topLeftCorner<3, 3>().setIdentity();
  J.block<3, 2>(3, beam_direction_param) = tangent_basis(beam.direction_in_cam);
  J(6, 5) = 1.0;
  return J * beam.cov * J.transpose();
}

double offset_of_line_m(const Beam& beam) { return beam.origin_in_cam.cross(beam.direction_in_cam).norm(); }

}  // namespace alidade
