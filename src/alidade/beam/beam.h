#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>

#include "alidade/camera/camera.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Noise of a rangefinder: σ² = (sigma_m + per_m · range)² + (incidence_m · tan i)², with i the angle between the beam
/// and the normal of the surface that it hits: the deeper the spot's footprint, the noisier the reading.
struct RangeNoise {
  double sigma_m = 0.002;
  double per_m = 0.0;        ///< Growth with range. [m/m]
  double incidence_m = 0.0;  ///< [m]

  [[nodiscard]] double sigma_at(double range_m, double tan_incidence = 0.0) const;
  bool operator==(const RangeNoise&) const = default;
};

/// Order of a beam's parameters in covariances and Jacobians: origin x, y, z [m], two coordinates of the direction in
/// its tangent basis [rad], scale.
inline constexpr int num_beam_params = 6;
/// Index of the first coordinate of the direction, and of the scale.
inline constexpr int beam_direction_param = 3, beam_scale_param = 5;
inline constexpr std::array<const char*, num_beam_params> beam_param_names{"origin_x_m",  "origin_y_m",  "origin_z_m",
                                                                           "direction_u", "direction_v", "scale"};
using BeamVector = Eigen::Matrix<double, num_beam_params, 1>;
using BeamMatrix = Eigen::Matrix<double, num_beam_params, num_beam_params>;

/// The beam of a single-point rangefinder in the camera frame. A reading L is the point
///     point_in_cam = origin_in_cam + scale · L · direction_in_cam.
/// A constant offset of the readings is absorbed by the origin: an offset c is equivalent to an origin moved by c along
/// the beam, and the two cannot be separated. Wang & Li, 2020, eq. (1).
struct Beam {
  Eigen::Vector3d origin_in_cam = Eigen::Vector3d::Zero();      ///< Point at which the reading is zero. [m]
  Eigen::Vector3d direction_in_cam = Eigen::Vector3d::UnitZ();  ///< Unit vector.
  double scale = 1.0;                                           ///< True metres per metre read.
  RangeNoise noise;
  /// Covariance of the six parameters, direction in tangent_basis(direction_in_cam); zero rows where fixed.
  BeamMatrix cov = BeamMatrix::Zero();
  /// Cross-covariance of the six parameters with those of the lens used in the calibration (6 × lens parameters): both
  /// come from the same photos. 0×0: independent. Without it, σ of predicted pixels would be too large.
  Eigen::MatrixXd cov_with_lens;

  /// The beam moved by a small step of its six parameters; the covariances are unchanged.
  [[nodiscard]] Beam retract(const BeamVector& step) const;
};

/// What is wrong with a beam: an origin or a scale that is not finite, a direction that is not a unit vector, a matrix
/// that is not a covariance. Empty if nothing is wrong.
[[nodiscard]] std::string fault(const Beam& beam);

/// The point at which a reading was taken, in the camera frame. [m]
[[nodiscard]] Eigen::Vector3d point_at(const Beam& beam, double range_m);

/// ∂ point_at / ∂ the six parameters.
[[nodiscard]] Eigen::Matrix<double, 3, num_beam_params> J_point_beam(const Beam& beam, double range_m);

struct BeamPoint {
  Eigen::Vector3d point_in_cam;
  Eigen::Matrix3d cov;  ///< [m²]
};

/// Point of a reading with its covariance from the beam's and σ of the reading: `sigma_range_m`, by default beam.noise.
[[nodiscard]] BeamPoint measured_point(const Beam& beam, double range_m, std::optional<double> sigma_range_m = {});

struct BeamPixel {
  Eigen::Vector2d px;
  Eigen::Matrix2d cov;  ///< [px²]
};

/// Pixel at which the camera sees the point of a reading, with distortion. Its covariance includes that of the beam, of
/// the lens (if `camera.cov` is known), their cross-covariance (if known), and σ of the reading. None where the point
/// is not visible.
[[nodiscard]] std::optional<BeamPixel> measured_pixel(const Beam& beam, const Camera& camera, double range_m,
                                                      std::optional<double> sigma_range_m = {});

/// Angles between the direction and the camera's x and y axes, as in Wang & Li: acos of its first two coordinates.
[[nodiscard]] Eigen::Vector2d direction_angles_rad(const Beam& beam);

/// Covariance (7×7) of origin [3], direction [3] (singular along the direction itself) and scale.
[[nodiscard]] Eigen::Matrix<double, 7, 7> embedded_covariance(const Beam& beam);
inline constexpr std::array<const char*, 7> embedded_beam_names{
    "origin_x_m", "origin_y_m", "origin_z_m", "direction_x", "direction_y", "direction_z", "scale"};

/// Distance of the beam's line from the camera centre, |origin × direction|. [m]
[[nodiscard]] double offset_of_line_m(const Beam& beam);

ALIDADE_PUBLIC_END
}  // namespace alidade
