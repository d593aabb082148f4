#include "alidade/calibrate/solve/homography.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "alidade/geometry/decompositions.h"

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

  // Rows h1, h2, h3 of H, each residual h1·p − u h3·p and h2·p − v h3·p: given h3, the others are linear least squares.
  Eigen::Matrix3d pp = Eigen::Matrix3d::Zero(), u_pp = pp, v_pp = pp, rr_pp = pp;
  for (std::size_t i = 0; i < from.size(); i += stride) {
    const Eigen::Vector3d p = normal_from * from[i].homogeneous();
    const Eigen::Vector3d q = normal_to * to[i].homogeneous();
    const Eigen::Matrix3d outer = p * p.transpose();
    pp += outer;
    u_pp += q.x() * outer;
    v_pp += q.y() * outer;
    rr_pp += q.head<2>().squaredNorm() * outer;
  }
  if (!rr_pp.allFinite() || !pp.allFinite()) return std::nullopt;
  const Eigen::LLT<Eigen::Matrix3d> llt(pp);
  const Eigen::Vector3d pivots = llt.matrixLLT().diagonal();
  if (llt.info() != Eigen::Success || !(pivots.minCoeff() > 1e-6 * pivots.maxCoeff())) return std::nullopt;  // a line
  const Eigen::Matrix3d h1_from_h3 = llt.solve(u_pp), h2_from_h3 = llt.solve(v_pp);
  const Eigen::Matrix3d S = rr_pp - u_pp * h1_from_h3 - v_pp * h2_from_h3;
  const SymmetricEigen3 eigen = symmetric_eigen3(S);
  if (!(eigen.values[1] > 1e-10 * rr_pp.trace())) return std::nullopt;  // two null vectors: images on a line

  const Eigen::Vector3d h3 = eigen.vectors.col(0);
  Eigen::Matrix3d H;
  H << (h1_from_h3 * h3).transpose(), (h2_from_h3 * h3).transpose(), h3.transpose();
  H = normal_to.inverse() * H * normal_from;
  return H * ((H(2, 2) < 0.0 ? -1.0 : 1.0) / H.norm());
}

}  // namespace alidade
