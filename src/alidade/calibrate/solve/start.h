#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "alidade/board/board_view.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"

namespace alidade {

/// fx, fy, cx, cy of an undistorted camera with zero skew, from homographies px ~ H (x, y, 1) of a planar board.
/// None if the views do not determine them (all boards parallel, or noise makes the conic indefinite).
/// Zhang, PAMI 22(11), 2000, §3.1 and appendix B.
[[nodiscard]] std::optional<Eigen::Vector4d> zhang_intrinsics(std::span<const Eigen::Matrix3d> px_from_board_plane);

/// One focal length with square pixels and a known principal point, from the orthogonality of the board's axes
/// and their equal length in every view. None if no view is tilted enough.
/// Hartley & Zisserman 2003, §8.6 (vanishing points of orthogonal directions).
[[nodiscard]] std::optional<double> focal_from_vanishing_points(std::span<const Eigen::Matrix3d> px_from_board_plane,
                                                                const Eigen::Vector2d& principal_point_px);

/// Pose of a planar board seen by a known camera: homography of the unprojected corners, decomposed. None if
/// there are fewer than four corners in front of the lens.
[[nodiscard]] std::optional<Rigid3> pose_from_plane(const Camera& camera, const BoardView& view,
                                                    std::span<const Eigen::Vector3d> board_points);

}  // namespace alidade
