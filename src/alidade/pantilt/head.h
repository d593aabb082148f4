#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

// The general pan-tilt head; docs/maths/pan-tilt-heads.md. Angles at every interface are encoder READINGS, as (pan,
// tilt) [rad]; the axis angle is scale · (reading − zero). Pan > 0 turns left, tilt > 0 turns up.

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Maps the encoder readings of a head to the angles of its axes: angle = scale · (reading + c cos reading + s sin
/// reading − zero). c and s model an eccentric encoder disc: an error with one period per revolution.
struct Encoder {
  double pan_zero_rad = 0.0;  ///< Corrected reading at a pan angle of zero.
  double tilt_zero_rad = 0.0;
  double pan_scale = 1.0;
  double tilt_scale = 1.0;
  double sigma_rad = 0.0;                                                               ///< σ of a reading.
  double pan_cos_rad = 0.0, pan_sin_rad = 0.0, tilt_cos_rad = 0.0, tilt_sin_rad = 0.0;  ///< Amplitudes c and s.

  /// Readings corrected for the error with one period per revolution.
  [[nodiscard]] Eigen::Vector2d corrected(const Eigen::Vector2d& readings_rad) const;
  /// ∂ angle / ∂ reading of (pan, tilt).
  [[nodiscard]] Eigen::Vector2d slopes(const Eigen::Vector2d& readings_rad) const;
  [[nodiscard]] Eigen::Vector2d angles(const Eigen::Vector2d& readings_rad) const;
  [[nodiscard]] Eigen::Vector2d readings(const Eigen::Vector2d& angles_rad) const;
  bool operator==(const Encoder&) const = default;
};

/// A pan-over-tilt head and the mounting of its camera. A point is transformed from the world to the camera by
///     point_in_pan = Exp(pan e_y) point_in_base − pan_to_tilt_m       (y of the base is the pan axis)
///     point_in_tilt = Exp(−tilt e_x) Exp(−skew e_z) point_in_pan − tilt_to_cam_m
///     point_in_cam = cam_from_tilt point_in_tilt
/// The tilt axis is (cos skew, sin skew, 0) in frame `pan`: perpendicular to the pan axis if the skew is zero.
struct Head {
  int id = 1;
  Rigid3 world_from_base;
  Eigen::Vector3d pan_to_tilt_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d tilt_to_cam_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond cam_from_tilt = Eigen::Quaterniond::Identity();
  Encoder encoder;
  double axes_skew_rad = 0.0;
};

/// A head and the camera that it carries.
struct RigHead {
  Head head;
  Camera camera;
};

/// The parameters of a head in order: world_from_base ξ (right perturbation: translation, rotation), pan_to_tilt,
/// tilt_to_cam, cam_from_tilt (right perturbation: rotation), pan zero, tilt zero, pan scale, tilt scale,
/// skew of the axes, amplitudes of the encoders' errors with one period per revolution.
inline constexpr int num_head_params = 24;
inline constexpr std::array<const char*, num_head_params> head_param_names{
    "base_x_m",        "base_y_m",        "base_z_m",        "base_rx_rad",     "base_ry_rad",     "base_rz_rad",
    "pan_to_tilt_x_m", "pan_to_tilt_y_m", "pan_to_tilt_z_m", "tilt_to_cam_x_m", "tilt_to_cam_y_m", "tilt_to_cam_z_m",
    "cam_rx_rad",      "cam_ry_rad",      "cam_rz_rad",      "pan_zero_rad",    "tilt_zero_rad",   "pan_scale",
    "tilt_scale",      "axes_skew_rad",   "pan_cos_rad",     "pan_sin_rad",     "tilt_cos_rad",    "tilt_sin_rad"};
/// Index of the first component of each; for zero and scale, tilt follows pan.
inline constexpr int base_param = 0, base_rotation_param = 3, pan_to_tilt_param = 6, tilt_to_cam_param = 9,
                     cam_rotation_param = 12, pan_zero_param = 15, pan_scale_param = 17, tilt_scale_param = 18,
                     axes_skew_param = 19, pan_cos_param = 20, pan_sin_param = 21, tilt_cos_param = 22,
                     tilt_sin_param = 23;
using HeadVector = Eigen::Matrix<double, num_head_params, 1>;

/// The head moved by a small step of its parameters.
[[nodiscard]] Head retract(const Head& head, const HeadVector& step);

/// Pose of a head's camera at these readings, its inverse, and the camera centre [m].
[[nodiscard]] Rigid3 world_from_cam(const Head& head, const Eigen::Vector2d& pan_tilt_rad);
[[nodiscard]] Rigid3 cam_from_world(const Head& head, const Eigen::Vector2d& pan_tilt_rad);
[[nodiscard]] Eigen::Vector3d cam_centre_in_world(const Head& head, const Eigen::Vector2d& pan_tilt_rad);

/// A head at one pair of readings with its sines and matrices precomputed, for projecting many points.
struct TurnedHead {
  TurnedHead(const Head& head, const Eigen::Vector2d& pan_tilt_rad);

  Eigen::Matrix3d cam_from_world_rotation;
  Eigen::Vector3d cam_from_world_translation;
  Eigen::Matrix3d cam_from_base_rotation;
  Eigen::Matrix3d cam_from_tilt_rotation;
  Eigen::Matrix3d tilt_from_pan_rotation;
  Eigen::Matrix3d pan_from_base_rotation;
  Eigen::Vector3d pan_to_tilt_m, tilt_to_cam_m;
  Eigen::Vector2d readings_rad;
  Eigen::Vector2d scales;                  ///< Scales of the encoder.
  Eigen::Vector2d angle_per_reading;       ///< ∂ angle / ∂ reading, pan and tilt.
  Eigen::Vector2d readings_from_zero_rad;  ///< Corrected reading − zero.

  [[nodiscard]] Eigen::Vector3d point_in_cam(const Eigen::Vector3d& point_in_world) const {
    return cam_from_world_rotation * point_in_world + cam_from_world_translation;
  }
  /// ∂ point_in_cam / ∂ (pan, tilt) readings; ∂ point_in_cam / ∂ point_in_world is cam_from_world_rotation.
  [[nodiscard]] Eigen::Matrix<double, 3, 2> J_point_readings(const Eigen::Vector3d& point_in_cam) const;
  /// ∂ point_in_cam / ∂ pose of the base: the first six parameters of the head.
  [[nodiscard]] Eigen::Matrix<double, 3, 6> J_point_base(const Eigen::Vector3d& point_in_base) const;
  /// cos and sin of the pan reading, then of the tilt reading: derivatives of the error with one period per revolution.
  [[nodiscard]] Eigen::Vector4d reading_waves() const;
  /// ∂ point_in_cam / ∂ parameters of the head. `waves`: reading_waves(), computed once for many points.
  [[nodiscard]] Eigen::Matrix<double, 3, num_head_params> J_point_head(const Eigen::Vector3d& point_in_cam,
                                                                       const Eigen::Vector4d& waves) const;
  [[nodiscard]] Eigen::Matrix<double, 3, num_head_params> J_point_head(const Eigen::Vector3d& point_in_cam) const {
    return J_point_head(point_in_cam, reading_waves());
  }
};

struct HeadPixel {
  Eigen::Vector2d px;
  Eigen::Vector3d point_in_cam;
  Eigen::Matrix<double, 2, 3> J_px_point;     ///< With respect to the point in the world.
  Eigen::Matrix<double, 2, 2> J_px_readings;  ///< With respect to the readings (pan, tilt).
};

/// Pixel of a world point through the lens with its distortion; none if the camera does not see it.
[[nodiscard]] std::optional<HeadPixel> project(const TurnedHead& turned, const Camera& camera,
                                               const Eigen::Vector3d& point_in_world);
[[nodiscard]] std::optional<HeadPixel> project(const RigHead& rig_head, const Eigen::Vector2d& pan_tilt_rad,
                                               const Eigen::Vector3d& point_in_world);

/// A ray in the world frame.
struct WorldRay {
  Eigen::Vector3d origin_in_world;
  Eigen::Vector3d direction_in_world;  ///< Unit vector.
};
/// The ray of a pixel at these readings. None if the lens model has no ray for the pixel.
[[nodiscard]] std::optional<WorldRay> ray_in_world(const RigHead& rig_head, const Eigen::Vector2d& pan_tilt_rad,
                                                   const Eigen::Vector2d& px);

/// The readings (pan angle in (−π, π]) at which a point of the world lies on a given ray of the camera, by default the
/// optical axis: closed form for a head without offsets, otherwise at most 6 Newton steps. None: no such readings.
[[nodiscard]] std::optional<Eigen::Vector2d> aim(const Head& head, const Eigen::Vector3d& point_in_world,
                                                 const Eigen::Vector3d& ray_in_cam = Eigen::Vector3d::UnitZ());

/// M = K [R | t] (3×4) at these readings: (u, v, 1) ~ M (X, Y, Z, 1), the lens taken without distortion.
[[nodiscard]] Eigen::Matrix<double, 3, 4> projection_matrix(const RigHead& rig_head,
                                                            const Eigen::Vector2d& pan_tilt_rad);

/// The two heads of Xiahou, Chen & Wu, 2015: no offsets, 0.50 m apart along x, f = 337.84 px, 320 × 240.
[[nodiscard]] std::array<RigHead, 2> xiahou_rig();

ALIDADE_PUBLIC_END
}  // namespace alidade
