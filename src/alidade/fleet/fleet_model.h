#pragma once

#include <Eigen/Geometry>

#include "alidade/fleet/camera_state.h"

namespace alidade {

using FleetCommon = Eigen::Matrix<double, num_fleet_common, 1>;
using FleetCommonMatrix = Eigen::Matrix<double, num_fleet_common, num_fleet_common>;
using FleetPixelByCommon = Eigen::Matrix<double, 2, num_fleet_common>;

/// A row's rotation without the zeros: base_from_cam = R_y(−pan zero) · before · R_x(tilt zero) · after.
struct FleetRotation {
  Eigen::Matrix3d before = Eigen::Matrix3d::Identity(), after = Eigen::Matrix3d::Identity();
};

/// Where a row sees a direction of the base, and the derivatives.
struct FleetPrediction {
  bool is_seen = false;
  Eigen::Vector2d px;
  FleetPixelByCommon by_common;        ///< Over fx, fy, cx, cy, zero of pan, zero of tilt, f per °C.
  Eigen::Matrix<double, 2, 3> by_ray;  ///< Over the direction.
};

/// The view of one row, so many °C above where fx and fy are what the shared parameters say.
class FleetView {
 public:
  FleetView(const FleetRotation& rotation, const FleetCommon& common, double warmer_c = 0.0);
  [[nodiscard]] FleetPrediction predict(const Eigen::Vector3d& ray_in_base) const;
  /// The direction that a pixel is seen along, in the base; of length 1.
  [[nodiscard]] Eigen::Vector3d ray_of(const Eigen::Vector2d& px) const;

 private:
  FleetCommon common_;
  double warmer_c_, zoom_;  ///< By the temperature.
  Eigen::Matrix3d cam_from_base_;
  Eigen::Vector3d tilt_axis_in_cam_;
};

/// e1 and e2 beside a direction of length 1.
[[nodiscard]] Eigen::Matrix<double, 3, 2> basis_beside(const Eigen::Vector3d& direction);

/// Of the row, as the camera's state has it: rates are integrated from the last row on.
[[nodiscard]] FleetRotation rotation_of(const FleetCamera& camera, const FleetRow& row);

}  // namespace alidade
