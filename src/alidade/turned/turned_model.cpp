#include "alidade/turned/turned_model.h"

#include <cmath>

#include "alidade/geometry/so3.h"

namespace alidade {
namespace {

constexpr double min_depth = 0.05;  // cosine of the angle to the optical axis: 87°

/// d, its derivative by r², and the derivative of r d by r, which is positive up to the fold of the lens.
struct RadialFactor {
  double d = 1.0, by_r2 = 0.0, growth = 1.0;
};

RadialFactor radial_factor(const TurnedCamera& camera, double r2) {
  const double k1 = camera[4], k2 = camera[5], k3 = camera[8], k4 = camera[9];
  return {1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4))), k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3 + 4.0 * r2 * k4)),
          1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * (7.0 * k3 + 9.0 * r2 * k4)))};
}

/// Derivative of a point in the normalised image plane by p1 and p2, in which it is linear.
Eigen::Matrix2d decentring(const Eigen::Vector2d& x) {
  const double r2 = x.squaredNorm(), xy = 2.0 * x.x() * x.y();
  Eigen::Matrix2d by_p;
  by_p << xy, r2 + 2.0 * x.x() * x.x(), r2 + 2.0 * x.y() * x.y(), xy;
  return by_p;
}

/// The distorted point, and its derivative by x.
struct Distorted {
  Eigen::Vector2d at;
  Eigen::Matrix2d by_x;
};

Distorted distorted(const TurnedCamera& camera, const Eigen::Vector2d& x) {
  const RadialFactor radial = radial_factor(camera, x.squaredNorm());
  const double p1 = camera[6], p2 = camera[7], across = 2.0 * (p1 * x.x() + p2 * x.y());
  Distorted out{radial.d * x + decentring(x) * camera.segment<2>(6),
                radial.d * Eigen::Matrix2d::Identity() + 2.0 * radial.by_r2 * x * x.transpose()};
  out.by_x(0, 0) += 2.0 * p1 * x.y() + 6.0 * p2 * x.x();
  out.by_x(1, 1) += 6.0 * p1 * x.y() + 2.0 * p2 * x.x();
  out.by_x(0, 1) += across;
  out.by_x(1, 0) += across;
  return out;
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
  const Eigen::Vector2d bent = radial.d * x + decentring(x) * camera.segment<2>(6);
  return Eigen::Vector2d(zoom * camera.head<2>().cwiseProduct(bent) + camera.segment<2>(2));
}

bool predict_turned(const TurnedCamera& camera, const Eigen::Matrix3d& R, double log_zoom, const Eigen::Vector3d& ray,
                    TurnedPrediction& out) {
  const Eigen::Vector3d Y = R * ray;
  if (!(Y.z() > min_depth * ray.norm())) return false;
  const double inverse = 1.0 / Y.z();
  const Eigen::Vector2d x = Y.head<2>() * inverse;
  const double r2 = x.squaredNorm();
  if (!(radial_factor(camera, r2).growth > 0.0)) return false;
  const Distorted bent = distorted(camera, x);
  const double zoom = std::exp(log_zoom);
  const Eigen::Vector2d f = zoom * camera.head<2>(), straight = f.cwiseProduct(x);
  out.px = f.cwiseProduct(bent.at) + camera.segment<2>(2);
  out.J_camera.leftCols<4>() << zoom * bent.at.x(), 0.0, 1.0, 0.0, 0.0, zoom * bent.at.y(), 0.0, 1.0;
  out.J_camera.col(4) = straight * r2;
  out.J_camera.col(5) = straight * r2 * r2;
  out.J_camera.middleCols<2>(6) = f.asDiagonal() * decentring(x);
  out.J_camera.col(8) = straight * r2 * r2 * r2;
  out.J_camera.col(9) = straight * r2 * r2 * r2 * r2;
  const Eigen::Matrix2d J_px_x = f.asDiagonal() * bent.by_x;
  Eigen::Matrix<double, 2, 3> J_x_Y;
  J_x_Y << inverse, 0.0, -x.x() * inverse, 0.0, inverse, -x.y() * inverse;
  const Eigen::Matrix<double, 2, 3> J_px_Y = J_px_x * J_x_Y;
  out.J_photo.leftCols<3>() = -J_px_Y * cross_matrix(Y);
  out.J_photo.col(3) = f.cwiseProduct(bent.at);
  out.J_ray = J_px_Y * R;
  return true;
}

std::optional<Eigen::Vector3d> turned_ray(const TurnedCamera& camera, double log_zoom, const Eigen::Vector2d& px) {
  const double zoom = std::exp(log_zoom);
  const Eigen::Vector2d target((px.x() - camera[2]) / (zoom * camera[0]), (px.y() - camera[3]) / (zoom * camera[1]));
  // Newton's method on r d(r), then in the plane for the terms of p1 and p2.
  const double far = target.norm();
  double r = far;
  for (int i = 0; i < 30; ++i) {
    const RadialFactor radial = radial_factor(camera, r * r);
    if (!(radial.growth > 1e-3)) return std::nullopt;
    const double step = (r * radial.d - far) / radial.growth;
    r -= step;
    if (std::abs(step) < 1e-13 * (1.0 + far)) break;
  }
  if (!(r >= 0.0)) return std::nullopt;
  Eigen::Vector2d x = far > 0.0 ? Eigen::Vector2d(target * (r / far)) : target;
  for (int i = 0; i < 10; ++i) {
    const Distorted bent = distorted(camera, x);
    const Eigen::Vector2d step = bent.by_x.inverse() * (bent.at - target);
    if (!step.allFinite()) return std::nullopt;
    x -= step;
    if (step.norm() < 1e-13 * (1.0 + far)) break;
  }
  const bool is_there = (distorted(camera, x).at - target).norm() < 1e-9 * (1.0 + far);
  if (!is_there || !(radial_factor(camera, x.squaredNorm()).growth > 0.0)) return std::nullopt;
  return Eigen::Vector3d(x.x(), x.y(), 1.0).normalized();
}

}  // namespace alidade
