#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/report/svg.h"

namespace alidade::report {

/// Parallel projection of the camera frame onto the paper. Parallel, so that planes map affinely and lengths compare.
struct View3 {
  Eigen::Vector3d right_in_cam = Eigen::Vector3d::UnitX();
  Eigen::Vector3d down_in_cam = Eigen::Vector3d::UnitY();
  double scale = 1.0;  ///< Paper units per metre.
  double x0 = 0.0, y0 = 0.0;

  /// From behind the camera's right shoulder, looking down: the scene lies to the right.
  static View3 three_quarter();
  static View3 from_above();  ///< z right, x down.
  static View3 from_side();   ///< z right, y down.

  /// Scaled and shifted so that the points fill the box.
  void fit(const std::vector<Eigen::Vector3d>& points_in_cam, Place corner, double width, double height);

  [[nodiscard]] Place at(const Eigen::Vector3d& point_in_cam) const;
  [[nodiscard]] double depth(const Eigen::Vector3d& point_in_cam) const;  ///< Larger is further from the eye.
};

}  // namespace alidade::report
