#include "alidade/calibrate/solve/start.h"

#include <Eigen/LU>
#include <cmath>

#include "alidade/calibrate/solve/homography.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

/// v_ij of Zhang's eq. (7) for zero skew: hᵢᵀ B hⱼ as a row on (B11, B22, B13, B23, B33).
Eigen::Matrix<double, 5, 1> conic_row(const Eigen::Matrix3d& H, int i, int j) {
  const Eigen::Vector3d a = H.col(i), b = H.col(j);
  return {a.x() * b.x(), a.y() * b.y(), a.x() * b.z() + a.z() * b.x(), a.y() * b.z() + a.z() * b.y(), a.z() * b.z()};
}

/// Pixels scaled to order one, so that the five unknowns are of one size.
Eigen::Matrix3d pixel_normaliser(std::span<const Eigen::Matrix3d> homographies) {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (const auto& H : homographies) centre += Eigen::Vector2d(H.col(2).hnormalized());
  centre /= static_cast<double>(homographies.size());
  const double scale = 1.0 / std::max(1.0, centre.norm());
  return (Eigen::Matrix3d() << scale, 0, -scale * centre.x(), 0, scale, -scale * centre.y(), 0, 0, 1).finished();
}

}  // namespace

std::optional<Eigen::Vector4d> zhang_intrinsics(std::span<const Eigen::Matrix3d> px_from_board_plane) {
  if (px_from_board_plane.size() < 2) return std::nullopt;
  const Eigen::Matrix3d N = pixel_normaliser(px_from_board_plane);
  Eigen::Matrix<double, 5, 5> VtV = Eigen::Matrix<double, 5, 5>::Zero();
  for (const auto& H_px : px_from_board_plane) {
    const Eigen::Matrix3d H = N * H_px;
    const double size = 1.0 / (0.5 * (H.col(0).squaredNorm() + H.col(1).squaredNorm()));
    const Eigen::Matrix<double, 5, 1> orthogonal = size * conic_row(H, 0, 1);
    const Eigen::Matrix<double, 5, 1> equal = size * (conic_row(H, 0, 0) - conic_row(H, 1, 1));
    VtV += orthogonal * orthogonal.transpose() + equal * equal.transpose();
  }
  if (!VtV.allFinite()) return std::nullopt;
  Eigen::Matrix<double, 5, 1> b = symmetric_eigen(VtV).vectors.col(0);
  if (b[0] < 0.0) b = -b;
  // B ~ K⁻ᵀK⁻¹ with B11 = 1/fx², B13 = −cx/fx², … up to scale λ.
  const double cx = -b[2] / b[0], cy = -b[3] / b[1];
  const double lambda = b[4] - b[0] * cx * cx - b[1] * cy * cy;
  const double fx2 = lambda / b[0], fy2 = lambda / b[1];
  if (!(fx2 > 0.0 && fy2 > 0.0)) return std::nullopt;
  const double scale = 1.0 / N(0, 0);
  const Eigen::Vector4d found(std::sqrt(fx2) * scale, std::sqrt(fy2) * scale, cx * scale - N(0, 2) * scale,
                              cy * scale - N(1, 2) * scale);
  if (!found.allFinite()) return std::nullopt;
  return found;
}

std::optional<double> focal_from_vanishing_points(std::span<const Eigen::Matrix3d> px_from_board_plane,
                                                  const Eigen::Vector2d& principal_point_px) {
  // With the principal point at 0, B ~ diag(w, w, 1), w = 1/f²: two linear equations a w + c = 0 a view.
  double aa = 0.0, ac = 0.0;
  for (const auto& H_px : px_from_board_plane) {
    Eigen::Matrix3d H = H_px;
    H.row(0) -= principal_point_px.x() * H_px.row(2);
    H.row(1) -= principal_point_px.y() * H_px.row(2);
    const double size = 1.0 / (H.col(0).squaredNorm() + H.col(1).squaredNorm());
    const auto add = [&](double a, double c) {
      aa += size * size * a * a;
      ac += size * size * a * c;
    };
    add(H(0, 0) * H(0, 1) + H(1, 0) * H(1, 1), H(2, 0) * H(2, 1));
    add(H.col(0).head<2>().squaredNorm() - H.col(1).head<2>().squaredNorm(), H(2, 0) * H(2, 0) - H(2, 1) * H(2, 1));
  }
  const double w = -ac / aa;
  if (!(w > 0.0) || !std::isfinite(w)) return std::nullopt;
  return 1.0 / std::sqrt(w);
}

std::optional<Rigid3> pose_from_plane(const Camera& camera, const BoardView& view,
                                      std::span<const Eigen::Vector3d> board_points) {
  constexpr std::size_t max_corners = 20;  // a start needs no more
  const std::size_t stride = (view.corners.size() + max_corners - 1) / max_corners;
  std::vector<Eigen::Vector2d> px, on_board, on_plane;
  for (std::size_t i = 0; i < view.corners.size(); i += stride) px.push_back(view.corners[i].px);
  const auto rays = unproject(camera, px);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!rays[i] || !(rays[i]->z() > 0.05)) continue;  // a plane at z = 1 shows nothing sideways
    on_plane.emplace_back(rays[i]->hnormalized());
    on_board.emplace_back(board_points[static_cast<std::size_t>(view.corners[i * stride].index)].head<2>());
  }
  const auto H = fit_homography(on_board, on_plane);
  if (!H) return std::nullopt;
  const Eigen::Vector2d centre = on_board[on_board.size() / 2];
  const double side = (*H * centre.homogeneous()).z() < 0.0 ? -1.0 : 1.0;  // the board is in front of the camera
  const Eigen::Matrix3d G = *H * (side * 2.0 / (H->col(0).norm() + H->col(1).norm()));
  // The orthonormal pair nearest to the first two columns A: A (AᵀA)^−½, with √B = (B + √|B| I) / √(tr B + 2 √|B|).
  const Eigen::Matrix<double, 3, 2> A = G.leftCols<2>();
  const Eigen::Matrix2d B = A.transpose() * A;
  const double root = std::sqrt(B.determinant());
  const Eigen::Matrix2d half = (B + root * Eigen::Matrix2d::Identity()) / std::sqrt(B.trace() + 2.0 * root);
  const Eigen::Matrix<double, 3, 2> axes = A * half.inverse();
  Eigen::Matrix3d R;
  R << axes, axes.col(0).cross(axes.col(1));
  if (!(root > 0.0) || !R.allFinite()) return std::nullopt;
  return Rigid3{Eigen::Quaterniond(R).normalized(), G.col(2)};
}

}  // namespace alidade
