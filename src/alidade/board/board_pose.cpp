#include "alidade/board/board_pose.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <vector>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// L⁻¹ of cov = L Lᵀ.
Eigen::Matrix2d whitener(const Eigen::Matrix2d& cov) {
  const double a = std::sqrt(cov(0, 0)), b = cov(1, 0) / a, c = std::sqrt(cov(1, 1) - b * b);
  return (Eigen::Matrix2d() << 1.0 / a, 0.0, -b / (a * c), 1.0 / c).finished();
}

/// The points' centroid and their mean distance from it.
std::pair<Eigen::Vector2d, double> centre_and_size(const BoardView& view, std::span<const Eigen::Vector3d> points) {
  const auto num = static_cast<double>(view.corners.size());
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double size = 0.0;
  for (const Corner& corner : view.corners) centre += points[static_cast<std::size_t>(corner.index)].head<2>() / num;
  for (const Corner& corner : view.corners)
    size += (points[static_cast<std::size_t>(corner.index)].head<2>() - centre).norm() / num;
  return {centre, size};
}

/// H with ray ~ H (x, y, 1) of points on the board, up to scale: null vector of ray × H p = 0. Rays instead of pixels
/// let it work behind the lens, too. None where the points are on a line.
std::optional<Eigen::Matrix3d> ray_homography(const Camera& camera, const BoardView& view,
                                              std::span<const Eigen::Vector3d> points) {
  const auto [centre, size] = centre_and_size(view, points);
  if (!(size > 0.0)) return std::nullopt;
  Eigen::Matrix<double, 9, 9> AtA = Eigen::Matrix<double, 9, 9>::Zero();
  Eigen::Vector3d side = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector2d> px;
  for (const Corner& corner : view.corners) px.push_back(corner.px);
  const auto rays = unproject(camera, px);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!rays[i]) continue;
    const auto index = static_cast<std::size_t>(view.corners[i].index);
    const Eigen::Vector3d p = ((points[index].head<2>() - centre) / size).homogeneous();
    const Eigen::Matrix3d cross = cross_matrix(*rays[i]);
    const Eigen::Matrix3d weight = cross.transpose() * cross, outer = p * p.transpose();
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) AtA.block<3, 3>(3 * a, 3 * b) += outer(a, b) * weight;
    side += *rays[i];
  }
  const SymmetricEigen eigen = symmetric_eigen(AtA);
  if (!(eigen.values[1] > 1e-9 * eigen.values[8])) return std::nullopt;
  Eigen::Matrix3d H = eigen.vectors.col(0).reshaped(3, 3);
  if (H.col(2).dot(side) < 0.0) H = -H;  // in front of the camera
  H.leftCols<2>() /= size;
  H.col(2) -= H.leftCols<2>() * centre;
  return H;
}

std::optional<Rigid3> start_pose(const Camera& camera, const BoardView& view, std::span<const Eigen::Vector3d> points) {
  const auto H = ray_homography(camera, view, points);
  if (!H) return std::nullopt;
  const double scale = 2.0 / (H->col(0).norm() + H->col(1).norm());
  Eigen::Matrix3d axes;
  axes << H->col(0) * scale, H->col(1) * scale, H->col(0).cross(H->col(1)) * scale * scale;
  const Eigen::Matrix3d R = nearest_rotation(axes);
  if (!R.allFinite() || !(R.determinant() > 0.0)) return std::nullopt;
  return Rigid3{Eigen::Quaterniond(R), H->col(2) * scale};
}

/// The other pose that looks nearly alike from far away: the normal mirrored at the view of the board's centre.
Rigid3 mirrored(const Rigid3& cam_from_board, const Eigen::Vector3d& centre_in_board) {
  const Eigen::Vector3d centre_in_cam = cam_from_board * centre_in_board;
  const Eigen::Vector3d view = centre_in_cam.normalized();
  const Eigen::Vector3d normal = cam_from_board.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d wanted = 2.0 * view.dot(normal) * view - normal;
  const Eigen::Quaterniond turn = rotation_between(normal, wanted);
  const Eigen::Quaterniond rotation = (turn * cam_from_board.rotation).normalized();
  return {rotation, centre_in_cam - rotation * centre_in_board};
}

/// The board perpendicular to the viewing ray, in the same position and with the same rotation about it: where a small
/// board's tilt is lost in noise, a homography can have any.
Rigid3 squared_up(const Rigid3& cam_from_board, const Eigen::Vector3d& centre_in_board) {
  const Eigen::Vector3d centre_in_cam = cam_from_board * centre_in_board;
  const Eigen::Quaterniond turn =
      rotation_between(cam_from_board.rotation * Eigen::Vector3d::UnitZ(), centre_in_cam.normalized());
  const Eigen::Quaterniond rotation = (turn * cam_from_board.rotation).normalized();
  return {rotation, centre_in_cam - rotation * centre_in_board};
}

struct Refined {
  Rigid3 cam_from_board;
  CornerResiduals residuals;
};

/// Second derivative of ½ |r|², by differences of its gradient g over a thousandth of σ; H its part by the slope of r.
/// That part where a difference reaches beside what the lens sees.
Matrix6 curvature(const Camera& camera, const Rigid3& cam_from_board, const Matrix6& H, const Vector6& g,
                  const BoardView& view, std::span<const Eigen::Vector3d> points, std::optional<double> sigma_px) {
  Matrix6 second;
  for (int k = 0; k < 6; ++k) {
    const double h = 1e-3 / std::sqrt(H(k, k));
    const auto beside = corner_residuals(camera, cam_from_board.retract(h * Vector6::Unit(k)), view, points, sigma_px);
    if (!beside) return H;
    second.col(k) = (beside->J_pose.transpose() * beside->r - g) / h;
  }
  return 0.5 * (second + second.transpose());
}

/// Levenberg–Marquardt. Between two similar poses the curvature of r is as large as its slope, and steps by the slope
/// alone creep or leap about: from the tenth step on by the whole curvature (Newton).
std::optional<Refined> refined(const Camera& camera, Rigid3 cam_from_board, const BoardView& view,
                               std::span<const Eigen::Vector3d> points, std::optional<double> sigma_px) {
  auto now = corner_residuals(camera, cam_from_board, view, points, sigma_px);
  if (!now) return std::nullopt;
  double damping = 1e-6, last2 = std::numeric_limits<double>::infinity();
  constexpr int max_iterations = 100, by_slope = 10;  // quadratic from a homography: 3–5 are typical
  for (int i = 0; i < max_iterations; ++i) {
    const Matrix6 H = now->J_pose.transpose() * now->J_pose;
    const Vector6 g = now->J_pose.transpose() * now->r;
    Matrix6 damped = i < by_slope ? H : curvature(camera, cam_from_board, H, g, view, points, sigma_px);
    damped.diagonal() += damping * H.diagonal();
    const Eigen::LLT<Matrix6> llt(damped);
    if (llt.info() != Eigen::Success) {  // negative curvature: not yet a minimum
      if (!damped.allFinite() || (damping = std::max(10.0 * damping, 1e-3)) > 1e12) break;
      continue;
    }
    const Vector6 step = -llt.solve(g);
    if (!step.allFinite()) return std::nullopt;
    // A step of 10⁻⁶ σ changes nothing that could be measured.
    const double step2 = step.dot(H * step);
    const bool is_small = step2 < 1e-12 * (1.0 + now->r.squaredNorm() * 1e-6);
    const Rigid3 trial = cam_from_board.retract(step);
    auto next = corner_residuals(camera, trial, view, points, sigma_px);
    if (next && next->r.squaredNorm() <= now->r.squaredNorm()) {
      cam_from_board = trial;
      now = std::move(next);
      damping = std::max(0.1 * damping, 1e-12);
      last2 = step2;
    } else if ((damping *= 10.0) > 1e12) {
      break;
    }
    if (is_small) return Refined{cam_from_board, std::move(*now)};
  }
  // Steps that stay small, but not that small: a hundredth of σ is as good.
  constexpr double as_good2 = 1e-4;
  return last2 < as_good2 ? std::optional(Refined{cam_from_board, std::move(*now)}) : std::nullopt;
}

BoardPoseFit fit_at(const Refined& at) {
  const Ldlt H(at.residuals.J_pose.transpose() * at.residuals.J_pose);
  BoardPoseFit fit;
  fit.pose = {at.cam_from_board, H.inverse()};
  fit.chi2 = at.residuals.r.squaredNorm();
  fit.dof = static_cast<int>(at.residuals.r.size()) - 6;
  fit.J_pose_lens = -H.solve_each(at.residuals.J_pose.transpose() * at.residuals.J_lens);
  return fit;
}

bool fits_board(const BoardView& view, std::span<const Eigen::Vector3d> points) {
  for (const Corner& corner : view.corners) {
    if (corner.index < 0 || static_cast<std::size_t>(corner.index) >= points.size()) return false;
  }
  return true;
}

}  // namespace

std::optional<CornerResiduals> corner_residuals(const Camera& camera, const Rigid3& cam_from_board,
                                                const BoardView& view, std::span<const Eigen::Vector3d> points_in_board,
                                                std::optional<double> sigma_px) {
  if (!fits_board(view, points_in_board)) return std::nullopt;
  std::vector<Eigen::Vector3d> points_in_cam;
  points_in_cam.reserve(view.corners.size());
  const Eigen::Matrix3d R = cam_from_board.rotation.toRotationMatrix();
  for (const Corner& corner : view.corners)
    points_in_cam.push_back(R * points_in_board[static_cast<std::size_t>(corner.index)] + cam_from_board.translation);
  const auto seen = project_with_jacobians(camera, points_in_cam);
  const auto rows = static_cast<Eigen::Index>(2 * seen.size());
  CornerResiduals out{Eigen::VectorXd(rows), Eigen::Matrix<double, Eigen::Dynamic, 6>(rows, 6), {}};
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) return std::nullopt;
    if (i == 0) out.J_lens.resize(rows, seen[i]->J_px_params.cols());
    const Corner& corner = view.corners[i];
    const Eigen::Matrix2d W =
        sigma_px ? Eigen::Matrix2d(Eigen::Matrix2d::Identity() / *sigma_px) : whitener(corner.cov);
    const Eigen::Matrix<double, 2, 3> J_board = W * seen[i]->J_px_point * R;
    const auto row = static_cast<Eigen::Index>(2 * i);
    out.r.segment<2>(row) = W * (seen[i]->px - corner.px);
    out.J_pose.block<2, 3>(row, 0) = J_board;
    out.J_pose.block<2, 3>(row, 3) = -J_board * cross_matrix(points_in_board[static_cast<std::size_t>(corner.index)]);
    out.J_lens.middleRows<2>(row) = W * seen[i]->J_px_params;
  }
  if (!out.r.allFinite()) return std::nullopt;
  return out;
}

std::vector<BoardPoseFit> fit_board_poses(const Camera& camera, const BoardView& view,
                                          std::span<const Eigen::Vector3d> points_in_board,
                                          std::optional<double> sigma_px) {
  if (view.corners.size() < 4 || !fits_board(view, points_in_board)) return {};
  const auto start = start_pose(camera, view, points_in_board);
  if (!start) return {};
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  centre.head<2>() = centre_and_size(view, points_in_board).first;
  std::vector<BoardPoseFit> fits;
  auto at = refined(camera, *start, view, points_in_board, sigma_px);
  if (!at) at = refined(camera, squared_up(*start, centre), view, points_in_board, sigma_px);
  if (at) fits.push_back(fit_at(*at));
  at = refined(camera, mirrored(at ? at->cam_from_board : *start, centre), view, points_in_board, sigma_px);
  if (at) fits.push_back(fit_at(*at));
  std::erase_if(fits, [](const BoardPoseFit& fit) { return !fit.pose.cov.allFinite(); });
  if (fits.size() == 2 && fits[1].chi2 < fits[0].chi2) std::swap(fits[0], fits[1]);
  return fits;
}

std::optional<BoardPoseFit> fit_board_pose(const Camera& camera, const BoardView& view,
                                           std::span<const Eigen::Vector3d> points_in_board,
                                           std::optional<double> sigma_px) {
  const std::vector<BoardPoseFit> fits = fit_board_poses(camera, view, points_in_board, sigma_px);
  if (fits.empty()) return std::nullopt;
  return fits.front();
}

}  // namespace alidade
