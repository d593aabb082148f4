#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_view.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace alidade {

/// Indices of the estimated parameters of a lens: those with a variance.
[[nodiscard]] std::vector<int> free_parameters(const Camera& camera);

/// Rows and columns of a matrix.
[[nodiscard]] Eigen::MatrixXd submatrix(const Eigen::MatrixXd& full, const std::vector<int>& rows);

/// Inverse of `submatrix`: a covariance over all parameters, zero where they are fixed.
[[nodiscard]] Eigen::MatrixXd full_matrix(const Eigen::MatrixXd& part, const std::vector<int>& rows, Eigen::Index size);

/// Noise-free view of all points of a board at a pose; none if a point is outside the image or within `margin_px` of
/// its border.
[[nodiscard]] std::optional<BoardView> predicted_view(const Camera& camera,
                                                      const std::vector<Eigen::Vector3d>& board_points,
                                                      const Rigid3& cam_from_board, double margin_px = 0.0);

/// A view's information about the free lens parameters at a pose, per unit noise of a corner's coordinate, the pose
/// eliminated: A − W V⁻¹ Wᵀ. None where a corner cannot be projected.
[[nodiscard]] std::optional<Eigen::MatrixXd> lens_information(const Camera& camera,
                                                              const std::vector<Eigen::Vector3d>& board_points,
                                                              const BoardView& view, const Rigid3& cam_from_board,
                                                              const std::vector<int>& free);

}  // namespace alidade
