#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "alidade/observe/intrinsics_estimate.h"

namespace alidade {

/// The optical flow under a rotation of the camera is linear in unknown constants Θ. For a static far point seen at
/// q = (px, py) and a camera that rotates with ω (camera frame, ṁ = −ω × m),
///
///   ṗx = [−px²ωy, 2pxωy, 0, pxpyωx, −pyωx, −pxωx | −ωy, ωx, 0, 0 | pyωz, −ωz, 0, 0] Θ
///   ṗy = [−pxpyωy, pyωy, pxωy, py²ωx, 0, −2pyωx | 0, 0, ωx, −ωy | 0, 0, −pxωz, ωz] Θ
///   Θ = (1/fx, u/fx, v/fx, 1/fy, u/fy, v/fy | fx + u²/fx, uv/fy, fy + v²/fy, uv/fx | fx/fy, fx v/fy, fy/fx, fy u/fx)
///
/// exactly, for constant intrinsics (fx, fy, u, v). Everything is in scaled pixels; see PixelScale. The first ten
/// columns are the whole flow if ωz = 0; the first six, differenced between two points, are those of Fang, Liu, Li &
/// Zhang, "A global exponential observer for camera calibration", 2011, eq. (11).
using FlowParameters = Eigen::Matrix<double, 14, 1>;
using FlowRegressor = Eigen::Matrix<double, 14, 2>;  ///< G: q̇ = Gᵀ Θ.

/// The difference of the flows of two points does not depend on Θ7 to Θ10, Θ12 and Θ14: θ = (Θ1 … Θ6, fx/fy, fy/fx).
using DifferenceParameters = Eigen::Matrix<double, 8, 1>;
using DifferenceRegressor = Eigen::Matrix<double, 8, 2>;  ///< Ω of one point: ẏ = Ωᵀ θ with y = q − q_reference.

/// Rows of Θ that remain in θ.
inline constexpr std::array<Eigen::Index, 8> difference_rows{0, 1, 2, 3, 4, 5, 10, 12};

[[nodiscard]] FlowRegressor flow_regressor(const Eigen::Vector2d& q, const Eigen::Vector3d& rate_rad_per_s);
[[nodiscard]] DifferenceRegressor difference_regressor(const Eigen::Vector2d& q, const Eigen::Vector2d& q_reference,
                                                       const Eigen::Vector3d& rate_rad_per_s);

/// Θ and θ for scaled intrinsics k = (fx, fy, u, v), and their derivatives by k.
[[nodiscard]] FlowParameters flow_parameters(const Eigen::Vector4d& k);
[[nodiscard]] Eigen::Matrix<double, 14, 4> flow_parameters_jacobian(const Eigen::Vector4d& k);
[[nodiscard]] DifferenceParameters difference_parameters(const Eigen::Vector4d& k);
[[nodiscard]] Eigen::Matrix<double, 8, 4> difference_parameters_jacobian(const Eigen::Vector4d& k);

/// A focal length above twenty half image widths is not an estimate yet.
inline constexpr double min_inverse_focal = 1.0 / 20.0;

[[nodiscard]] constexpr double squared(double x) { return x * x; }

/// Scaled intrinsics k from θ. θ gives (u, v) twice; both are fused: u = (θ2θ1 + θ5θ4)/(θ1² + θ4²). None while
/// θ1 or θ4 is not above `least` (a focal length of 1/least in scaled pixels), since 1/θ passes through infinity.
[[nodiscard]] std::optional<Eigen::Vector4d> intrinsics_of(const DifferenceParameters& theta, double least);
/// Derivative of intrinsics_of() by θ, for a θ that has intrinsics.
[[nodiscard]] Eigen::Matrix<double, 4, 8> intrinsics_jacobian(const DifferenceParameters& theta);

/// (fx, fy, cx, cy) to and from scaled pixels.
[[nodiscard]] Eigen::Vector4d scaled_intrinsics(const PixelScale& scale, const Eigen::Vector4d& px);
[[nodiscard]] Eigen::Vector4d intrinsics_in_px(const PixelScale& scale, const Eigen::Vector4d& k);

}  // namespace alidade
