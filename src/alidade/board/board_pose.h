#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A board's pose with the covariance of its right perturbation ξ; zero: exact.
struct BoardPose {
  Rigid3 cam_from_board;
  Eigen::Matrix<double, 6, 6> cov = Eigen::Matrix<double, 6, 6>::Zero();
};

/// Whitened residuals of the corners of one view, two rows per corner in the order of the view, with their derivatives
/// with respect to the pose's right perturbation ξ = [translation, rotation] and to the lens parameters.
struct CornerResiduals {
  Eigen::VectorXd r;
  Eigen::Matrix<double, Eigen::Dynamic, 6> J_pose;
  Eigen::MatrixXd J_lens;  ///< One column per lens parameter.
};

/// None if a corner is outside the lens model's domain, or has an index that the board does not have. `sigma_px`
/// replaces the corners' covariances.
[[nodiscard]] std::optional<CornerResiduals> corner_residuals(const Camera& camera, const Rigid3& cam_from_board,
                                                              const BoardView& view,
                                                              std::span<const Eigen::Vector3d> points_in_board,
                                                              std::optional<double> sigma_px = {});

struct BoardPoseFit {
  BoardPose pose;
  double chi2 = 0.0;  ///< Sum of the squared whitened residuals.
  int dof = 0;
  /// Sensitivity of the pose to the lens: ∂ξ/∂(lens parameters), 6 × number of lens parameters.
  Eigen::Matrix<double, 6, Eigen::Dynamic> J_pose_lens;
};

/// Maximum-likelihood pose of a flat (or nearly flat) board with at least four corners, for a known camera; the initial
/// guess is a homography of the corners' rays. A distant board has two similar solutions: the better one is returned.
/// None for too few corners, collinear corners, indices that the board does not have, or no convergence.
[[nodiscard]] std::optional<BoardPoseFit> fit_board_pose(const Camera& camera, const BoardView& view,
                                                         std::span<const Eigen::Vector3d> points_in_board,
                                                         std::optional<double> sigma_px = {});

/// The same, with both solutions that a distant board has, if there are two: the better one first.
[[nodiscard]] std::vector<BoardPoseFit> fit_board_poses(const Camera& camera, const BoardView& view,
                                                        std::span<const Eigen::Vector3d> points_in_board,
                                                        std::optional<double> sigma_px = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
