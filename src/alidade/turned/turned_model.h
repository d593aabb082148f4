#pragma once

#include <Eigen/Geometry>
#include <array>
#include <optional>

namespace alidade {

inline constexpr int num_camera = 10, per_photo = 4;  ///< Per photo: its rotation (3) and log zoom.

/// fx, fy, cx, cy, k1, k2, p1, p2, k3, k4. Pixels are normalised, (px − centre) / half width, and so are fx, fy, cx,
/// cy.
using TurnedCamera = Eigen::Matrix<double, num_camera, 1>;
using TurnedInformation = Eigen::Matrix<double, num_camera, num_camera>;
inline constexpr std::array<int, 4> radial_places{4, 5, 8, 9};  ///< Indices of k1 to k4 in it.
inline constexpr int num_radial = 3;                            ///< Estimated radial terms: k4 is only tested.
inline constexpr int decentring_place = 6;                      ///< Index of p1; p2 follows.

/// Pixel of a far point, with its derivatives.
struct TurnedPrediction {
  Eigen::Vector2d px;
  Eigen::Matrix<double, 2, num_camera> J_camera;
  Eigen::Matrix<double, 2, per_photo> J_photo;  ///< Rotation on the left, R ← Exp(φ) R, and log zoom.
  Eigen::Matrix<double, 2, 3> J_ray;
};

/// Normalised pixel of the direction `ray`, camera_from_world Y = R ray: u = fx e^z (x d + 2 p1 x y +
/// p2 (r² + 2 x²)) + cx with x = Y₀/Y₂ and d = 1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸ (Brown 1971). None behind the camera,
/// or beyond the fold of the lens.
[[nodiscard]] std::optional<Eigen::Vector2d> turned_pixel(const TurnedCamera& camera, const Eigen::Matrix3d& R,
                                                          double log_zoom, const Eigen::Vector3d& ray);
[[nodiscard]] bool predict_turned(const TurnedCamera& camera, const Eigen::Matrix3d& R, double log_zoom,
                                  const Eigen::Vector3d& ray, TurnedPrediction& out);

/// Unit direction of a normalised pixel in the camera; none beyond the fold.
[[nodiscard]] std::optional<Eigen::Vector3d> turned_ray(const TurnedCamera& camera, double log_zoom,
                                                        const Eigen::Vector2d& px);

}  // namespace alidade
