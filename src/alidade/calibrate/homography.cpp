#include "alidade/calibrate/homography.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

namespace alidade {
namespace {

/// Similarity that moves the centroid to 0 and the mean distance to √2.
Eigen::Matrix3d normaliser(std::span<const Eigen::Vector2d> points, std::size_t stride) {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double count = 0.0, spread = 0.0;
  for (std::size_t i = 0; i < points.size(); i += stride, count += 1.0) centre += points[i];
  centre /= count;
  for (std::size_t i = 0; i < points.size(); i += stride) spread += (points[i] - centre).norm();
  const double scale = std::sqrt(2.0) * count / std::max(spread, 1e-300);
  return (Eigen::Matrix3d() << scale, 0, -scale * centre.x(), 0, scale, -scale * centre.y(), 0, 0, 1).finished();
}

}  // namespace

std::optional<Eigen::Matrix3d> fit_homography(std::span<const Eigen::Vector2d> from,
                                              std::span<const Eigen::Vector2d> to, std::size_t max_points) {
  if (from.size() < 4 || to.size() != from.size()) return std::nullopt;
  const std::size_t stride = (from.size() + max_points - 1) / max_points;
  const Eigen::Matrix3d normal_from = normaliser(from, stride), normal_to = normaliser(to, stride);

  Eigen::Matrix<double, 9, 9> AtA = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < from.size(); i += stride) {
    const Eigen::Vector3d p = normal_from * from[i].homogeneous();
    const Eigen::Vector3d q = normal_to * to[i].homogeneous();
    const Eigen::Matrix3d pp = p * p.transpose();  // rows (0, −p, v p) and (p, 0, −u p) of A
    AtA.block<3, 3>(0, 0) += pp;
    AtA.block<3, 3>(3, 3) += pp;
    AtA.block<3, 3>(0, 6) -= q.x() * pp;
    AtA.block<3, 3>(3, 6) -= q.y() * pp;
    AtA.block<3, 3>(6, 6) += q.head<2>().squaredNorm() * pp;
  }
  if (!AtA.allFinite()) return std::nullopt;
  AtA.block<3, 3>(6, 0) = AtA.block<3, 3>(0, 6);
  AtA.block<3, 3>(6, 3) = AtA.block<3, 3>(3, 6);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(AtA);
  if (!(eigen.eigenvalues()[1] > 1e-10 * eigen.eigenvalues()[8])) return std::nullopt;  // two null vectors: a line

  const Eigen::Matrix<double, 9, 1> h = eigen.eigenvectors().col(0);
  Eigen::Matrix3d H;
  H << h.segment<3>(0).transpose(), h.segment<3>(3).transpose(), h.segment<3>(6).transpose();
  H = normal_to.inverse() * H * normal_from;
  return H * ((H(2, 2) < 0.0 ? -1.0 : 1.0) / H.norm());
}

}  // namespace alidade
