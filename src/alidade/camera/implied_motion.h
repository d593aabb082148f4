#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/camera/projection_sigma.h"

namespace alidade::detail {

/// A pixel of a grid as its camera sees it: the point there and the derivatives of its projection.
struct GridPoint {
  Eigen::Vector3d point_in_cam;
  LensProjection projection;
};

/// What the camera sees at each pixel of the grid, `distance_m` away (for infinity a unit ray, or a very far point
/// where the lens is not central); row-major.
[[nodiscard]] std::vector<std::optional<GridPoint>> look(const Camera& camera, const PixelGrid& grid,
                                                         double distance_m);

/// Derivative of a point's pixel by a small motion x → x + φ × x + range·τ: 6 columns τ, φ; τ has no unit, which keeps
/// the columns alike in size. At infinity (range 0) the rotation alone: 3 columns φ.
using MotionJacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 6>;
[[nodiscard]] MotionJacobian motion_jacobian(const GridPoint& at, double range_m);

/// Covariance of each pixel [px²], G Σ Gᵀ with G = J_params + J_motion K: the lens changes by dp and the motion follows
/// by K dp = argmin Σ weight |J_params dp + J_motion K dp|². Weights per grid point, those of unseen points are not
/// read.
[[nodiscard]] std::vector<Eigen::Matrix2d> implied_covariance(const Eigen::MatrixXd& cov,
                                                              std::span<const std::optional<GridPoint>> seen,
                                                              std::span<const double> weights, double range_m);

/// projection_sigma() at pixels of one's own; the motion is that of a grid over the image. NaN where there is none.
[[nodiscard]] std::vector<double> sigma_at(const Camera& camera, std::span<const Eigen::Vector2d> pixels,
                                           double distance_m);

/// Square root of the larger eigenvalue of a symmetric 2×2 matrix.
[[nodiscard]] double largest_sigma(const Eigen::Matrix2d& cov);

/// 1/σ² [px⁻²] of each pixel, bounded so that one that is known exactly does not take everything; 1 where all σ are 0.
[[nodiscard]] std::vector<double> inverse_variance_weights(std::span<const double> sigmas_px);

}  // namespace alidade::detail
