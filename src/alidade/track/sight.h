#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <optional>

#include "alidade/estimation/iterated_update.h"
#include "alidade/pantilt/head.h"

namespace alidade {

/// One sight of the target: where a head's camera saw it, and what the encoders read at that instant.
struct TargetSight {
  double t_capture_s = 0.0;  ///< When the picture was taken and the encoders read.
  double t_arrival_s = 0.0;  ///< When it was known; ≥ t_capture_s.
  std::size_t head = 0;      ///< Place in the rig's list of heads.
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
};

/// h of one sight: the head as it stood, and its camera. Lives as long as the camera.
struct SightModel {
  TurnedHead turned;
  const Camera* camera;

  SightModel(const RigHead& head, const Eigen::Vector2d& pan_tilt_rad)
      : turned(head.head, pan_tilt_rad), camera(&head.camera) {}

  [[nodiscard]] std::optional<PositionSeen> operator()(const Eigen::Vector3d& position) const {
    const auto seen = project_with_jacobians(*camera, turned.point_in_cam(position));
    if (!seen) return std::nullopt;
    return PositionSeen{seen->px, seen->J_px_point * turned.cam_from_world_rotation};
  }

  /// R = σ_px² I + σ_enc² J Jᵀ, J by the readings, there.
  [[nodiscard]] Eigen::Matrix2d noise(const Eigen::Vector3d& position, const PositionSeen& seen, double sigma_px,
                                      double sigma_encoder_rad) const {
    const Eigen::Matrix<double, 2, 2> J = seen.J_z_position * turned.cam_from_world_rotation.transpose() *
                                          turned.J_point_readings(turned.point_in_cam(position));
    return sigma_px * sigma_px * Eigen::Matrix2d::Identity() +
           sigma_encoder_rad * sigma_encoder_rad * J * J.transpose();
  }

  [[nodiscard]] double depth_m(const Eigen::Vector3d& position) const {
    return turned.cam_from_world_rotation.row(2).dot(position) + turned.cam_from_world_translation.z();
  }
};

}  // namespace alidade
