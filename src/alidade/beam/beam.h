#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>

#include "alidade/camera/camera.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// How well a rangefinder reads: σ² = (sigma_m + per_m · range)² + (incidence_m · tan i)², with i the angle between the
/// beam and the normal of what it hits (the wider the spot's footprint in depth, the less sure the reading).
struct RangeNoise {
  double sigma_m = 0.002;
  double per_m = 0.0;        ///< Growth with the range. [m/m]
  double incidence_m = 0.0;  ///< [m]

  [[nodiscard]] double sigma_at(double range_m, double tan_incidence = 0.0) const;
  bool operator==(const RangeNoise&) const = default;
};

/// Order of a beam's parameters in covariances and Jacobians: origin x, y, z [m], two coordinates of the direction in
/// its tangent basis [rad], scale.
inline constexpr int num_beam_params = 6;
/// Indices of the direction's first coordinate and of the scale.
inline constexpr int beam_direction_param = 3, beam_scale_param = 5;
inline constexpr std::array<const char*, num_beam_params> beam_param_names{"origin_x_m",  "origin_y_m",  "origin_z_m",
                                                                           "direction_u", "direction_v", "scale"};
using BeamVector = Eigen::Matrix<double, num_beam_params, 1>;
using BeamMatrix = Eigen::Matrix<double, num_beam_params, num_beam_params>;

/// The beam of a single-point rangefinder in the frame of a camera: a reading L is the point
///     point_in_cam = origin_in_cam + scale · L · direction_in_cam.
/// The origin takes up whatever constant the instrument adds to its readings: an offset c is an origin that is moved by
/// c along the beam, and nothing separates the two. Wang & Li, 2020, eq. (1).
struct Beam {
  Eigen::Vector3d origin_in_cam = Eigen::Vector3d::Zero();      ///< Where the reading is zero. [m]
  Eigen::Vector3d direction_in_cam = Eigen::Vector3d::UnitZ();  ///< Unit vector.
  double scale = 1.0;                                           ///< Metres for each metre read.
  RangeNoise noise;
  /// Of the six parameters, the direction in tangent_basis(direction_in_cam); zero rows for what was fixed.
  BeamMatrix cov = BeamMatrix::Zero();
  /// Covariance of the six parameters with those of the lens it was calibrated with (6 × parameters): both were found
  /// from the same photos. 0×0: independent. Without it a pixel would seem to be worse known than it is.
  Eigen::MatrixXd cov_with_lens;

  /// The beam moved by a small step of its six parameters; covariances stay as they are.
  [[nodiscard]] Beam retract(const BeamVector& step) const;
};

/// What is wrong with a beam: an origin or a scale that is not finite, a direction that is not of length one, a matrix
/// that is no covariance. Empty where nothing is.
[[nodiscard]] std::string fault(const Beam& beam);

/// Point of a reading. [m]
[[nodiscard]] Eigen::Vector3d point_at(const Beam& beam, double range_m);

/// ∂ point_at / ∂ the six parameters.
[[nodiscard]] Eigen::Matrix<double, 3, num_beam_params> J_point_beam(const Beam& beam, double range_m);

struct BeamPoint {
  Eigen::Vector3d point_in_cam;
  Eigen::Matrix3d cov;  ///< [m²]
};

/// Point of a reading with its covariance: the beam's, and the reading's by `sigma_range_m` (by beam.noise without).
[[nodiscard]] BeamPoint measured_point(const Beam& beam, double range_m, std::optional<double> sigma_range_m = {});

struct BeamPixel {
  Eigen::Vector2d px;
  Eigen::Matrix2d cov;  ///< [px²]
};

/// Where the camera sees the point of a reading, through its lens; covariance of the beam, of the lens where
/// `camera.cov` is known, of both together where the beam knows that, and of the reading. None where the point is not
/// seen.
[[nodiscard]] std::optional<BeamPixel> measured_pixel(const Beam& beam, const Camera& camera, double range_m,
                                                      std::optional<double> sigma_range_m = {});

/// Angles of the direction to the camera's x and y axes, as the paper reports it: acos of its first two coordinates.
[[nodiscard]] Eigen::Vector2d direction_angles_rad(const Beam& beam);

/// Covariance (7×7) of origin [3], direction [3] (singular along the direction), scale.
[[nodiscard]] Eigen::Matrix<double, 7, 7> embedded_covariance(const Beam& beam);
inline constexpr std::array<const char*, 7> embedded_beam_names{
    "origin_x_m", "origin_y_m", "origin_z_m", "direction_x", "direction_y", "direction_z", "scale"};

/// Distance of the beam's line from the camera's centre, |origin × direction|. [m]
[[nodiscard]] double offset_of_line_m(const Beam& beam);

ALIDADE_PUBLIC_END
}  // namespace alidade
