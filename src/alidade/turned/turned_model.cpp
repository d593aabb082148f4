#include "alidade/turned/turned_model.h"

#include <cmath>

#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

constexpr double min_depth = 0.05;  // cosine of the angle to the axis: 87°

/// d and the derivative of r d by r; that one above zero: the lens does not fold.
struct RadialFactor {
  double d = 1.0, by_r2 = 0.0, growth = 1.0;
};

RadialFactor radial_factor(const TurnedCamera& camera, double r2) {
  const double k1 = camera[4], k2 = camera[5];
  return {1.0 + r2 * (k1 + k2 * r2), k1 + 2.0 * k2 * r2, 1.0 + r2 * (3.0 * k1 + 5.0 * k2 * r2)};
}

}  // namespace

std::optional<Eigen::Vector2d> turned_pixel(const TurnedCamera& camera, const Eigen::Matrix3d& R, double log_zoom,
                                            const Eigen::Vector3d& ray) {
  const Eigen::Vector3d Y = R * ray;
  if (!(Y.z() > min_depth * ray.norm())) return std::nullopt;
  const Eigen::Vector2d x = Y.head<2>() / Y.z();
  const RadialFactor radial = radial_factor(camera, x.squaredNorm());
  if (!(radial.growth > 0.0)) return std::nullopt;
  const double zoom = log_zoom == 0.0 ? 1.0 : std::exp(log_zoom);
  return Eigen::Vector2d(zoom * camera[0] * x.x() * radial.d + camera[2],
                         zoom * camera[1] * x.y() * radial.d + camera[3]);
}

bool predict_turned(const TurnedCamera& camera, const Eigen::Matrix3d& R, double log_zoom, const Eigen::Vector3d& ray,
                    TurnedPrediction& out) {
  const Eigen::Vector3d Y = R * ray;
  if (!(Y.z() > min_depth * ray.norm())) return false;
  const double inverse = 1.0 / Y.z();
  const Eigen::Vector2d x = Y.head<2>() * inverse;
  const double r2 = x.squaredNorm();
  const RadialFactor radial = radial_factor(camera, r2);
  if (!(radial.growth > 0.0)) return false;
  const double zoom = std::exp(log_zoom);
  const Eigen::Vector2d f = zoom * camera.head<2>();
  const Eigen::Vector2d bent = f.cwiseProduct(x);  // of k1 times r²
  out.px = bent * radial.d + camera.segment<2>(2);
  out.J_camera << zoom * x.x() * radial.d, 0.0, 1.0, 0.0, bent.x() * r2, bent.x() * r2 * r2,  //
      0.0, zoom * x.y() * radial.d, 0.0, 1.0, bent.y() * r2, bent.y() * r2 * r2;
  const Eigen::Matrix2d J_px_x =
      f.asDiagonal() * (radial.d * Eigen::Matrix2d::Identity() + 2.0 * radial.by_r2 * x * x.transpose());
  Eigen::Matrix<double, 2, 3> J_x_Y;
  J_x_Y << inverse, 0.0, -x.x() * inverse, 0.0, inverse, -x.y() * inverse;
  const Eigen::Matrix<double, 2, 3> J_px_Y = J_px_x * J_x_Y;
  out.J_photo.leftCols<3>() = -J_px_Y * cross_matrix(Y);
  out.J_photo.col(3) = bent * radial.d;
  out.J_ray = J_px_Y * R;
  return true;
}

std::optional<Eigen::Vector3d> turned_ray(const TurnedCamera& camera, double log_zoom, const Eigen::Vector2d& px) {
  const double zoom = std::exp(log_zoom);
  const Eigen::Vector2d bent((px.x() - camera[2]) / (zoom * camera[0]), (px.y() - camera[3]) / (zoom * camera[1]));
  const double target = bent.norm();
  double r = target;
  for (int i = 0; i < 30; ++i) {  // Newton on r d(r) = target
    const RadialFactor radial = radial_factor(camera, r * r);
    if (!(radial.growth > 1e-3)) return std::nullopt;
    const double step = (r * radial.d - target) / radial.growth;
    r -= step;
    if (std::abs(step) < 1e-13 * (1.0 + target)) break;
  }
  const RadialFactor radial = radial_factor(camera, r * r);
  if (!(radial.growth > 0.0) || !(r >= 0.0) || std::abs(r * radial.d - target) > 1e-9 * (1.0 + target))
    return std::nullopt;
  const double shrink = target > 0.0 ? r / target : 1.0;
  return Eigen::Vector3d(bent.x() * shrink, bent.y() * shrink, 1.0).normalized();
}

}  // namespace alidade
