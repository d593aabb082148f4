#pragma once

#include <Eigen/Core>
#include <optional>

#include "alidade/estimation/iterated_update.h"
#include "alidade/pantilt/head.h"
#include "alidade/pantilt/target_observation.h"

namespace alidade {

/// h and R of one observation: the head's pose, its camera, and the noise of pixel and encoder. Must not outlive
/// the camera.
struct ObservationModel {
  TurnedHead turned;
  const Camera* camera;
  double variance_px2, variance_rad2;
  std::optional<Zoomed> zoomed;  ///< If the lens is not the camera's own.

  ObservationModel(const RigHead& head, const Eigen::Vector2d& pan_tilt_rad, double sigma_px, double sigma_encoder_rad,
                   const std::optional<ObservationLens>& lens = {})
      : turned(head.head, pan_tilt_rad),
        camera(&head.camera),
        variance_px2(sigma_px * sigma_px),
        variance_rad2(sigma_encoder_rad * sigma_encoder_rad) {
    if (lens) zoomed.emplace(head.camera, lens->k);
  }

  /// R = σ_px² I + σ_enc² J Jᵀ, J with respect to the readings, at the position.
  [[nodiscard]] std::optional<PositionSeen> operator()(const Eigen::Vector3d& position) const {
    const Eigen::Vector3d point_in_cam = turned.point_in_cam(position);
    auto seen = project_with_jacobians(*camera, point_in_cam);
    if (!seen) return std::nullopt;
    if (zoomed) {
      seen->px = zoomed->px(seen->px);
      seen->J_px_point = zoomed->ratio.asDiagonal() * seen->J_px_point;
    }
    const Eigen::Matrix2d J = seen->J_px_point * turned.J_point_readings(point_in_cam);
    PositionSeen result{seen->px, seen->J_px_point * turned.cam_from_world_rotation, variance_rad2 * J * J.transpose()};
    result.R.diagonal().array() += variance_px2;
    return result;
  }

  [[nodiscard]] double depth_m(const Eigen::Vector3d& position) const {
    return turned.cam_from_world_rotation.row(2).dot(position) + turned.cam_from_world_translation.z();
  }
};

}  // namespace alidade
