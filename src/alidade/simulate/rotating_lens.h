#pragma once

#include <Eigen/Core>

#include "alidade/simulate/rotation.h"

namespace alidade {

/// Pixel of a ray (x, y, 1).
[[nodiscard]] inline Eigen::Vector2d px_of_ray(const RotatingIntrinsics& k, const Eigen::Vector2d& ray) {
  const double x = ray.x(), y = ray.y(), r2 = ray.squaredNorm();
  const Eigen::Vector2d bent =
      ray * (1.0 + r2 * (k.k1 + r2 * (k.k2 + r2 * k.k3))) +
      Eigen::Vector2d(2.0 * k.p1 * x * y + k.p2 * (r2 + 2.0 * x * x), k.p1 * (r2 + 2.0 * y * y) + 2.0 * k.p2 * x * y);
  return {k.fx * bent.x() + k.cx, k.fy * bent.y() + k.cy};
}

/// The ray (x, y, 1) of a pixel: Newton's method on the radius.
[[nodiscard]] inline Eigen::Vector3d ray_of_px(const RotatingIntrinsics& k, const Eigen::Vector2d& px) {
  const Eigen::Vector2d bent((px.x() - k.cx) / k.fx, (px.y() - k.cy) / k.fy);
  if (k.k1 == 0.0 && k.k2 == 0.0 && k.k3 == 0.0 && k.p1 == 0.0 && k.p2 == 0.0) return {bent.x(), bent.y(), 1.0};
  if (k.k2 != 0.0 || k.k3 != 0.0 || k.p1 != 0.0 || k.p2 != 0.0) {
    Eigen::Vector2d ray = bent;  // what the lens adds changes slowly: taken off again and again
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector2d off = px_of_ray(k, ray) - px;
      ray -= Eigen::Vector2d(off.x() / k.fx, off.y() / k.fy);
    }
    return {ray.x(), ray.y(), 1.0};
  }
  const double radius = bent.norm();
  double r = radius, step = 1.0;
  for (int i = 0; i < 20 && std::abs(step) > 1e-14; ++i) {
    step = (r + k.k1 * r * r * r - radius) / (1.0 + 3.0 * k.k1 * r * r);
    r -= step;
  }
  const Eigen::Vector2d ray = radius > 0.0 ? Eigen::Vector2d(bent * (r / radius)) : bent;
  return {ray.x(), ray.y(), 1.0};
}

}  // namespace alidade
