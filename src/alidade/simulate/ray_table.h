#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/camera/camera.h"

namespace alidade {

/// Unit rays of the pixels of a rectangle, computed exactly on every fourth pixel and by cubic interpolation between
/// (Lagrange, error below 1e-4 px: tested), because inverting the lens for each pixel costs more than the rest of a
/// rendering. Where the lens sees nothing the ray is NaN.
class RayTable {
 public:
  /// Columns u_min … u_max and rows v_min … v_max, inclusive.
  RayTable(const Camera& camera, int u_min, int u_max, int v_min, int v_max);

  [[nodiscard]] Eigen::Vector3d ray(int u, int v) const;

 private:
  static constexpr int step_px = 4;
  [[nodiscard]] const Eigen::Vector3d& node(int col, int row) const {
    return nodes_[static_cast<std::size_t>(row) * static_cast<std::size_t>(cols_) + static_cast<std::size_t>(col)];
  }

  Camera camera_;
  int u_min_, v_min_, cols_, rows_;
  std::vector<Eigen::Vector3d> nodes_;
};

}  // namespace alidade
