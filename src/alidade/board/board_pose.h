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

/// A board's pose, with the covariance of its right perturbation ξ; zero: exact.
struct BoardPose {
  Rigid3 cam_from_board;
  Eigen::Matrix<double, 6, 6> cov = Eigen::Matrix<double, 6, 6>::Zero();
};

/// Whitened residuals of the corners of one view, two rows a corner in the view's order, with their derivatives by the
/// pose's right perturbation ξ = [translation, rotation] and by the lens.
struct CornerResiduals {
  Eigen::VectorXd r;
  Eigen::Matrix<double, Eigen::Dynamic, 6> J_pose;
  Eigen::MatrixXd J_lens;  ///< As many columns as the lens has parameters.
};

/// None where a corner is outside the lens' domain, or has an index that the board does not have. `sigma_px`: replaces
/// the corners' covariances.
[[nodiscard]] std::optional<CornerResiduals> corner_residuals(const Camera& camera, const Rigid3& cam_from_board,
                                                              const BoardView& view,
                                                              std::span<const Eigen::Vector3d> points_in_board,
                                                              std::optional<double> sigma_px = {});

struct BoardPoseFit {
  BoardPose pose;
  double chi2 = 0.0;  ///< Sum of the squared whitened residuals.
  int dof = 0;
  /// Sensitivity of the pose to the lens: ∂ξ/∂(lens parameters), 6 × their number.
  Eigen::Matrix<double, 6, Eigen::Dynamic> J_pose_lens;
};

/// Pose of a flat (or nearly flat) board of at least four corners in front of a known camera, by maximum likelihood
/// from a homography of the corners' rays; of the two poses that a distant board nearly has, the better one. None for
/// too few corners, collinear corners, indices that the board does not have, or no convergence.
[[nodiscard]] std::optional<BoardPoseFit> fit_board_pose(const Camera& camera, const BoardView& view,
                                                         std::span<const Eigen::Vector3d> points_in_board,
                                                         std::optional<double> sigma_px = {});

/// The same with both poses that a distant board nearly has, where there are two: the better one first.
[[nodiscard]] std::vector<BoardPoseFit> fit_board_poses(const Camera& camera, const BoardView& view,
                                                        std::span<const Eigen::Vector3d> points_in_board,
                                                        std::optional<double> sigma_px = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
