#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/camera/camera.h"

namespace alidade {

/// Unit rays of the pixels of a rectangle, computed exactly at every fourth pixel and by cubic interpolation between
/// (Lagrange, error below 1e-4 px: tested), because inverting the lens at each pixel costs more than the rest of a
/// rendering. Outside the lens's view the ray is NaN. The rays of a non-central lens also have origins.
class RayTable {
 public:
  /// Columns u_min … u_max and rows v_min … v_max, inclusive.
  RayTable(const Camera& camera, int u_min, int u_max, int v_min, int v_max);

  [[nodiscard]] Eigen::Vector3d ray(int u, int v) const;
  /// Origin of that ray in the camera frame [m]; zero for a central lens.
  [[nodiscard]] Eigen::Vector3d origin(int u, int v) const;

 private:
  using Nodes = std::vector<Eigen::Vector3d>;
  static constexpr int step_px = 4;
  /// Cubic interpolation; NaN next to a node that is NaN.
  [[nodiscard]] Eigen::Vector3d interpolate(const Nodes& nodes, int u, int v) const;

  Camera camera_;
  int u_min_, v_min_, cols_, rows_;
  Nodes nodes_;
  Nodes origins_;  ///< Empty for a central lens.
};

}  // namespace alidade
