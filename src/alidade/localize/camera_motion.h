#pragma once

#include <Eigen/Core>

#include "alidade/geometry/rigid3.h"
#include "alidade/geometry/so3_jacobian.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Pose and velocity of a moving camera. Its error has 12 components, in this order: position in the world, rotation on
/// the right (q = q̂ exp(δθ)), velocity in the world, angular rate in the camera's frame.
struct CameraMotion {
  Rigid3 world_from_cam;
  Eigen::Vector3d velocity_in_world = Eigen::Vector3d::Zero();  ///< [m/s]
  Eigen::Vector3d rate_in_cam = Eigen::Vector3d::Zero();        ///< [rad/s]
};

inline constexpr int motion_dim = 12;
using MotionMatrix = Eigen::Matrix<double, motion_dim, motion_dim>;

/// The motion after a time Δ at constant velocity and rate: r + vΔ, q exp(ωΔ).
/// A. J. Davison et al., "MonoSLAM: Real-Time Single Camera SLAM", PAMI 29(6), 2007, eq. (6), with ω in the camera.
[[nodiscard]] CameraMotion moved(const CameraMotion& motion, double dt_s);

/// Derivatives of moved() with respect to the error before it, and to a step [V, Ω] of velocity and rate at its start.
struct MotionJacobians {
  MotionMatrix F;
  Eigen::Matrix<double, motion_dim, 6> G;
};
[[nodiscard]] MotionJacobians motion_jacobians(const CameraMotion& motion, double dt_s);

/// Process noise Q = G diag((σ_a Δ)² I, (σ_α Δ)² I) Gᵀ: accelerations constant during Δ, independent between steps.
[[nodiscard]] MotionMatrix motion_noise(const MotionJacobians& jacobians, double sigma_a_m_s2,
                                        double sigma_alpha_rad_s2, double dt_s);

/// Motion ⊞ error: the nominal motion, corrected by an error of 12 components.
[[nodiscard]] CameraMotion retract(const CameraMotion& motion, const Eigen::Vector<double, motion_dim>& error);

/// The error by which retract() moves the pose `from` to `to`: position in the world [m], rotation on the right [rad].
[[nodiscard]] Eigen::Vector<double, 6> pose_difference(const Rigid3& to, const Rigid3& from);

ALIDADE_PUBLIC_END
}  // namespace alidade
