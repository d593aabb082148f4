#include "alidade/simulate/boards/ray_table.h"

#include <algorithm>
#include <array>
#include <limits>

namespace alidade {
namespace {

ObservationRay ray_or_nan(const Camera& camera, double u, double v) {
  const Eigen::Vector3d nowhere = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  return observation_ray(camera, {u, v}).value_or(ObservationRay{nowhere, nowhere});
}

/// Lagrange's cubic weights of four nodes at −1, 0, 1, 2 for a position x in [0, 1).
std::array<double, 4> cubic_weights(double x) {
  return {-x * (x - 1.0) * (x - 2.0) / 6.0, (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0, -(x + 1.0) * x * (x - 2.0) / 2.0,
          (x + 1.0) * x * (x - 1.0) / 6.0};
}

}  // namespace

RayTable::RayTable(const Camera& camera, int u_min, int u_max, int v_min, int v_max)
    : camera_(camera),
      u_min_(u_min - step_px),  // one node before and two after, so that every pixel has four around it
      v_min_(v_min - step_px),
      cols_((u_max - u_min) / step_px + 4),
      rows_((v_max - v_min) / step_px + 4) {
  nodes_.reserve(static_cast<std::size_t>(cols_) * static_cast<std::size_t>(rows_));
  const bool central = is_central(camera_.lens);
  for (int row = 0; row < rows_; ++row) {
    for (int col = 0; col < cols_; ++col) {
      const ObservationRay ray = ray_or_nan(camera_, u_min_ + step_px * col, v_min_ + step_px * row);
      nodes_.push_back(ray.direction_in_cam);
      if (!central) origins_.push_back(ray.origin_in_cam);
    }
  }
}

Eigen::Vector3d RayTable::interpolate(const Nodes& nodes, int u, int v) const {
  const int col = (u - u_min_) / step_px - 1, row = (v - v_min_) / step_px - 1;
  static const std::array<std::array<double, 4>, step_px> weights{cubic_weights(0.0), cubic_weights(0.25),
                                                                  cubic_weights(0.5), cubic_weights(0.75)};
  const auto& across = weights[static_cast<std::size_t>((u - u_min_) % step_px)];
  const auto& down = weights[static_cast<std::size_t>((v - v_min_) % step_px)];
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  for (int j = 0; j < 4; ++j) {
    const Eigen::Vector3d* node =
        &nodes[static_cast<std::size_t>(row + j) * static_cast<std::size_t>(cols_) + static_cast<std::size_t>(col)];
    value += down[static_cast<std::size_t>(j)] *
             (across[0] * node[0] + across[1] * node[1] + across[2] * node[2] + across[3] * node[3]);
  }
  return value;
}

// Beside a hole of the lens: exact.
Eigen::Vector3d RayTable::ray(int u, int v) const {
  const Eigen::Vector3d ray = interpolate(nodes_, u, v);
  return ray.allFinite() ? ray : ray_or_nan(camera_, u, v).direction_in_cam;
}

Eigen::Vector3d RayTable::origin(int u, int v) const {
  if (origins_.empty()) return Eigen::Vector3d::Zero();
  const Eigen::Vector3d origin = interpolate(origins_, u, v);
  return origin.allFinite() ? origin : ray_or_nan(camera_, u, v).origin_in_cam;
}

}  // namespace alidade
